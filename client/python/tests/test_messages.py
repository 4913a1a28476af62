"""Every message can be filled, sent and read, whatever version and implementation of protobuf there is."""

import unittest

import scindo.tool
from google.protobuf.descriptor import FieldDescriptor
from scindo.v1 import _files, messages_of

_NUMBERS = (FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT)


def fill(message, depth=0):
    """Sets every field, of every inner message as well; the last of a choice stays."""
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        # A list, before and after protobuf 6 renamed the question.
        repeated = hasattr(value, "extend")
        if field.cpp_type == FieldDescriptor.CPPTYPE_MESSAGE:
            fill(value.add() if repeated else value, depth + 1)
            continue
        if field.cpp_type == FieldDescriptor.CPPTYPE_STRING:
            one = b"ab" if field.type == FieldDescriptor.TYPE_BYTES else "ab"
        else:
            one = 0.5 if field.cpp_type in _NUMBERS else 1
        if repeated:
            value.append(one)
        else:
            setattr(message, field.name, one)
    return depth


class Messages(unittest.TestCase):
    def test_each_survives_the_way(self):
        count = 0
        for file in _files.file:
            name = file.name.rsplit("/", 1)[-1].rsplit(".", 1)[0]
            for message in messages_of(name).values():
                if not hasattr(message, "FromString"):
                    continue
                sent = message()
                fill(sent)
                self.assertEqual(message.FromString(sent.SerializeToString()), sent)
                count += 1
        self.assertEqual(count, sum(len(file.message_type) for file in _files.file))
        self.assertGreater(count, 50)

    def test_every_shape(self):
        for kind, fields in scindo.tool._FIELDS.items():
            shape = scindo.tool.to_shape({kind: {name: 0.5 for name in fields}})
            self.assertEqual(shape.WhichOneof("kind"), kind)
            self.assertEqual(len(getattr(shape, kind).DESCRIPTOR.fields), len(fields), "no field is forgotten")


if __name__ == "__main__":
    unittest.main()

"""The messages of the wire, as ``proto/scindo/v1`` defines them: ``from scindo.v1 import cut_pb2``.

The classes are made from the descriptors of those files when the package is imported. They use the public interface of
protobuf only, so that one wheel goes with every protobuf from 4.22 on. They live in a pool of their own, and
collide with no other copy of the messages in the same program.
"""

from importlib import resources
from typing import Any, Dict, List

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

_inner: List[Any] = []
_pool = descriptor_pool.DescriptorPool()
_files = descriptor_pb2.FileDescriptorSet.FromString(resources.files(__name__).joinpath("messages.binpb").read_bytes())
for _file in _files.file:
    _pool.AddSerializedFile(_file.SerializeToString())


def messages_of(name: str) -> Dict[str, Any]:
    """Classes of the messages of ``scindo/v1/<name>.proto``, by their names."""
    file = _pool.FindFileByName(f"scindo/v1/{name}.proto")
    classes: Dict[str, Any] = {"DESCRIPTOR": file}
    for message, descriptor in file.message_types_by_name.items():
        # The inner ones first: protobuf before 4.25 crashes in a field whose class nobody has asked for.
        _inner.extend(message_factory.GetMessageClass(inner) for inner in descriptor.nested_types)
        classes[message] = message_factory.GetMessageClass(descriptor)
    return classes

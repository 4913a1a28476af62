"""Messages that pyigtl does not have, or cannot read."""

import struct

import numpy as np
import pyigtl
from pyigtl.messages import MessageBase, message_type_to_class_constructor


class Poly(pyigtl.PolyDataMessage):
    """`POLYDATA` with its attributes. pyigtl 0.3.4 writes the message, but its reader fails and knows no attributes."""

    def _unpack_content(self, content):
        counts = struct.unpack_from(">10I", content)
        n_points, n_polygons, polygon_bytes, n_attributes = counts[0], counts[5], counts[6], counts[9]
        assert counts[1:5] == (0, 0, 0, 0) and counts[7:9] == (0, 0), counts
        at = 40
        self.points = np.frombuffer(content, ">f4", 3 * n_points, at).reshape(-1, 3)
        at += 12 * n_points
        cells = np.frombuffer(content, ">u4", polygon_bytes // 4, at).reshape(n_polygons, 4)
        assert (cells[:, 0] == 3).all()
        self.polygons = cells[:, 1:].astype(int)
        at += polygon_bytes
        assert n_attributes == 1
        kind, components, n_values = struct.unpack_from(">BBI", content, at)
        assert (kind, components, n_values) == (2, 3, n_points)
        end = content.index(b"\0", at + 6)
        assert content[at + 6 : end] == b"Normals"
        at += 6 + (end + 1 - at - 6 + 1) // 2 * 2
        self.normals = np.frombuffer(content, ">f4", 3 * n_points, at).reshape(-1, 3)
        assert at + 12 * n_points == len(content)
        self._valid_message = True


class Status(MessageBase):
    def _unpack_content(self, content):
        self.code, self.subcode = struct.unpack_from(">Hq", content)
        self.error = content[10:30].rstrip(b"\0").decode()
        self.text = content[30:].rstrip(b"\0").decode()
        self._valid_message = True


class Tracking(MessageBase):
    """`TDATA`: names and matrices of tools."""

    def __init__(self, tools=(), device_name=None):
        MessageBase.__init__(self, device_name=device_name)
        self._message_type, self.tools, self._valid_message = "TDATA", dict(tools), True

    def _pack_content(self):
        def tool(name, matrix):
            columns = np.asarray(matrix)[:3, :].T.astype(">f4")
            return struct.pack(">20sBB", name.encode(), 1, 0) + columns.tobytes()

        return b"".join(tool(*one) for one in self.tools.items())

    def _unpack_content(self, content):
        self.tools = {}
        for at in range(0, len(content), 70):
            name = content[at : at + 20].rstrip(b"\0").decode()
            matrix = np.eye(4)
            matrix[:3, :] = np.frombuffer(content, ">f4", 12, at + 22).reshape(4, 3).T
            self.tools[name] = matrix
        self._valid_message = True


class Bare(MessageBase):
    """A message of any type with any content."""

    def __init__(self, kind="", content=b"", device_name=""):
        MessageBase.__init__(self, device_name=device_name)
        self._message_type, self.content, self._valid_message = kind, content, True

    def _pack_content(self):
        return self.content

    def _unpack_content(self, content):
        self.content = content
        self._valid_message = True


message_type_to_class_constructor.update(
    POLYDATA=Poly, STATUS=Status, TDATA=Tracking, CAPABILITY=Bare, RTS_TDATA=Bare, RTS_POLYDATA=Bare
)

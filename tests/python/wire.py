"""The messages of scindo.v1, generated from proto/ into a temporary folder at import."""

import importlib
import pathlib
import sys
import tempfile

from grpc_tools import protoc

_PROTO = pathlib.Path(__file__).resolve().parents[2] / "proto"
_OUT = tempfile.TemporaryDirectory(prefix="scindo-proto-")

_files = [str(f.relative_to(_PROTO)) for f in sorted(_PROTO.glob("scindo/v1/*.proto"))]
if protoc.main(["protoc", f"-I{_PROTO}", f"--python_out={_OUT.name}", *_files]) != 0:
    raise RuntimeError(f"protoc refused {_files}")
sys.path.insert(0, _OUT.name)

cut_pb2 = importlib.import_module("scindo.v1.cut_pb2")
force_pb2 = importlib.import_module("scindo.v1.force_pb2")
server_pb2 = importlib.import_module("scindo.v1.server_pb2")
surface_pb2 = importlib.import_module("scindo.v1.surface_pb2")
tool_pb2 = importlib.import_module("scindo.v1.tool_pb2")
viewer_pb2 = importlib.import_module("scindo.v1.viewer_pb2")

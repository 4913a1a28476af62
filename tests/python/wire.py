"""The messages of scindo.v1, as the Python package has them. The package need not be installed."""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "client/python/src"))

from scindo.v1 import (  # noqa: E402, F401
    cut_pb2,
    force_pb2,
    server_pb2,
    surface_pb2,
    tool_pb2,
    viewer_pb2,
)

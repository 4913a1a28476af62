"""The messages of scindo/v1/record.proto. Written by client/python/generate."""

from scindo.v1 import messages_of

globals().update(messages_of("record"))

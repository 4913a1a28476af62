"""Prints a TCP port on loopback that is free together with the next one, where a server sends its surfaces.

Below the ports that the system gives to outgoing connections: none of those takes it meanwhile.
"""

import random
import socket


def free(port):
    with socket.socket() as one:
        try:
            one.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


print(next(port for port in random.sample(range(10_000, 30_000, 2), 10_000) if free(port) and free(port + 1)))

"""Device protocols: bytes in, records out; no port is opened here. See docs/protocols.md."""

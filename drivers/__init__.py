"""Bytes to samples and back: the serial protocols of the Kobuki base and the Hokuyo URG-04LX-UG01."""

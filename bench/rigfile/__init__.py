"""The rig file: a rig as data, checked, and what its tables mean."""

from bench.rigfile.load import load_rig
from bench.rigfile.model import Device, LinkSpec, RigFile
from bench.rigfile.text import MOST_DBC, MOST_TOML, read_rig

__all__ = ["MOST_DBC", "MOST_TOML", "Device", "LinkSpec", "RigFile", "load_rig", "read_rig"]

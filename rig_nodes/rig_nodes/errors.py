"""The one exception of the rig that users are meant to read.

Everything that refuses input raises it; the command line prints its sentence and ends with its exit code.
"""


class RigError(Exception):
    """Bad input or an impossible request, said in one sentence: what, where, what would be right."""

    exit_code = 2


class BagError(RigError):
    """A bag that cannot be read, with the offset of the damage and a hint what to do."""

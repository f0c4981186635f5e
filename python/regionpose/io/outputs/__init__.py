"""Files that commands write: whole or not at all, all of a run together, and never over existing ones unless forced."""

from regionpose.io.outputs.claims import Claim, claimed, refuse_existing, text_writer, write_file, write_files
from regionpose.io.outputs.placing import Writer

__all__ = ["Claim", "Writer", "claimed", "refuse_existing", "text_writer", "write_file", "write_files"]

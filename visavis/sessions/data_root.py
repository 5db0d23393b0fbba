"""The folder a lab records in: made for those who may see its data."""

from lab.config import LabConfig
from recording.durable import make_folder, share_with_group


def prepare_data_root(lab: LabConfig) -> None:
    """Make the data root, where it is missing, for its owner or for the lab's group.

    Raises:
        RecordingError: it cannot be made, or there is no such group.
    """
    make_folder(lab.data_root, exist_ok=True)
    if lab.privacy.group:
        share_with_group(lab.data_root, lab.privacy.group)

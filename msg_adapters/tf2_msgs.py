"""``tf2_msgs``, which is not among the wheels: whether it is there, and frames to and from its messages."""

from collections.abc import Iterable

from msg_adapters.geometry_msgs import frame_to_transform, transform_to_frame
from sand_sim.border import Frame

try:
    from tf2_msgs.msg import TFMessage
except ModuleNotFoundError:
    TFMessage = None


def message_to_frames(message, fixed: bool = False) -> list[Frame]:
    """The frames that a message tells.

    Args:
        message: ``TFMessage``.
        fixed: whether they hold for all times, as those of ``/tf_static``.
    """
    return [transform_to_frame(transform, fixed) for transform in message.transforms]


def frames_to_message(frames: Iterable[Frame]):
    """Frames to a ``TFMessage``."""
    return TFMessage(transforms=[frame_to_transform(frame) for frame in frames])

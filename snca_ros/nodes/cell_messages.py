"""(ROS) Encodes and decodes the messages between cells: spike trains or values."""

import numpy as np
from sensor_msgs.msg import Image

from sim_node import message_layout
from sim_node.control_time import step_of_stamp
from sim_node.episode import EXAMPLE_EPISODE, check_frame, frame_of
from sim_node.errors import InvalidInput
from sim_node.ros.cdr import WireFormat
from snca_ros.cell.architecture import Architecture
from snca_ros.nodes.interfaces import SPIKES, VALUES


class CellMessages:
    """Encodes and decodes the messages that a voxel's cell sends, as sensor_msgs/Image.

    A row is a channel: 16 SNN steps as mono8 pixels 0 or 255 (topic `spikes`), or one 64FC1
    value (topic `values`). A directional cell stacks the channels for above, left, below, right.

    Args:
        architecture: of the cell.
        voxel: name of the sending voxel.

    Attributes:
        format: of the serialised messages.
        shape: of a message, (n_destinations, n_c, width).
    """

    def __init__(self, architecture: Architecture, voxel: str) -> None:
        self.shape = (
            architecture.n_destinations, architecture.n_c, architecture.message_width
        )
        self._spiking = architecture.spiking
        n_destinations, n_c, width = self.shape
        count = n_destinations * n_c * width
        dtype = np.uint8 if self._spiking else np.float64
        example = np.arange(1, count + 1).astype(dtype)
        image = Image(
            height=n_destinations * n_c,
            width=width,
            encoding='mono8' if self._spiking else '64FC1',
            step=width * np.dtype(dtype).itemsize,
            data=example.tobytes(),
        )
        image.header.frame_id = frame_of(voxel)
        self._fixed = {
            'height': image.height, 'width': image.width, 'encoding': image.encoding,
            'is_bigendian': 0, 'step': image.step,
        }
        self._voxel, self._n_bytes = voxel, len(image.data)
        episode = np.frombuffer(EXAMPLE_EPISODE, np.uint8)
        layout = message_layout.image(voxel, EXAMPLE_EPISODE, image.encoding, self._n_bytes)
        numbers = {'data': example, 'episode': episode}
        self.format = WireFormat(image, layout, numbers, self._check)

    def _check(self, image: Image) -> None:
        check_frame(self._voxel, image.header.frame_id)
        for name, expected in self._fixed.items():
            if getattr(image, name) != expected:
                raise InvalidInput(name, getattr(image, name), repr(expected))
        if len(image.data) != self._n_bytes:
            raise InvalidInput('data', f'{len(image.data)} bytes', f'{self._n_bytes} bytes')

    def encode(
        self, episode: np.ndarray, stamp: tuple[int, int], outbox: np.ndarray
    ) -> bytes:
        """Return the serialised message of (n_destinations, n_c, width) spikes or values."""
        data = (outbox * 255).astype(np.uint8) if self._spiking else outbox
        return self.format.encode(stamp, data=data, episode=episode)

    def decode(self, data: bytes) -> tuple[bytes, int, np.ndarray]:
        """Return (episode, step, (n_destinations, n_c, width) spikes 0.0/1.0 or values).

        Raises:
            InvalidInput: this is no Image of this voxel's cell, or its stamp is no control step,
                or a pixel or value is out of range.
        """
        try:
            stamp, (numbers, episode) = self.format.decode(data, 'data', 'episode')
        except InvalidInput:
            raise
        except Exception as error:
            raise InvalidInput('message', str(error), 'a sensor_msgs/Image') from None
        if self._spiking:
            if numbers.tobytes().strip(b'\x00\xff'):
                raise InvalidInput('data', 'other pixel values', '0 or 255 in every pixel')
            numbers = numbers / 255.0
        elif not (np.abs(numbers) <= 1.0).all():
            raise InvalidInput('data', numbers.tolist(), 'values from -1 to 1')
        return episode.tobytes(), step_of_stamp(*stamp), numbers.reshape(self.shape)


def topic_name(architecture: Architecture) -> str:
    """Return the topic below `<voxel>/` on which cells of this architecture send."""
    return (SPIKES if architecture.spiking else VALUES).name

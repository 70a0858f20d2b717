"""Layouts of serialised ROS messages (CDR) as numpy dtypes.

The encoding is little-endian CDR: an encapsulation header of 4 bytes, then the fields in the order
of the message's definition, each aligned to its size from the end of the header. A string is its
length including the terminating zero, its characters, and the zero; a sequence is its length and
its items. Where lengths vary, a layout is that of a message with the given strings and lengths.
"""

from collections.abc import Sequence

import numpy as np

_ENCAPSULATION = 4
_Field = tuple[str, str]  # name, and numpy type string
_STAMP: tuple[_Field, ...] = (('sec', '<i4'), ('nanosec', '<u4'))


def joint_state(
    sender: str, episode: bytes, names: Sequence[str], n_effort: int = 0
) -> np.dtype:
    """Return the layout of a sensor_msgs/JointState with one `position` per name.

    Args:
        sender: first part of its frame_id, the name of a voxel or of a robot.
        episode: second part of its frame_id.
        names: its names.
        n_effort: number of values of `effort`.
    """
    return _layout(
        *_header_of(sender, episode),
        ('name.size', '<u4'),
        *(field for i, name in enumerate(names) for field in _string(f'name.{i}', name)),
        ('position.size', '<u4'), ('position', f'({len(names)},)<f8'),
        ('velocity.size', '<u4'), ('effort.size', '<u4'), ('effort', f'({n_effort},)<f8'),
    )


def image(voxel: str, episode: bytes, encoding: str, n_bytes: int) -> np.dtype:
    """Return the layout of a sensor_msgs/Image with `n_bytes` bytes of data."""
    return _layout(
        *_header_of(voxel, episode),
        ('height', '<u4'), ('width', '<u4'), *_string('encoding', encoding),
        ('is_bigendian', 'u1'), ('step', '<u4'),
        ('data.size', '<u4'), ('data', f'({n_bytes},)u1'),
    )


def clock() -> np.dtype:
    """Return the layout of a rosgraph_msgs/Clock."""
    return _layout(*_STAMP)


def odometry(frame: str, child_frame: str) -> np.dtype:
    """Return the layout of a nav_msgs/Odometry with `position` (3,) and linear `velocity` (3,)."""
    return _layout(
        *_STAMP, *_string('frame_id', frame), *_string('child_frame_id', child_frame),
        ('position', '(3,)<f8'), ('orientation', '(4,)<f8'), ('covariance', '(36,)<f8'),
        ('velocity', '(3,)<f8'), ('rotation', '(3,)<f8'), ('covariance.2', '(36,)<f8'),
    )


def markers(*described: tuple[str, str, int, int]) -> np.dtype:
    """Return the layout of a visualization_msgs/MarkerArray.

    Args:
        described: frame, namespace, number of points and number of colours of each marker. Its
            fields are named `<namespace>_points`, `<namespace>_colors` and so on.
    """
    return _layout(
        ('markers.size', '<u4'), *(field for marker in described for field in _marker(*marker))
    )


def _marker(frame: str, namespace: str, n_points: int, n_colors: int) -> list[_Field]:
    fields: list[_Field] = [
        *_STAMP, *_string('frame_id', frame), *_string('ns', namespace),
        ('id', '<i4'), ('type', '<i4'), ('action', '<i4'),
        ('pose', '(7,)<f8'), ('scale', '(3,)<f8'), ('color', '(4,)<f4'),
        ('lifetime', '(2,)<i4'), ('frame_locked', 'u1'),
        ('points.size', '<u4'), ('points', f'({n_points},3)<f8'),
        ('colors.size', '<u4'), ('colors', f'({n_colors},4)<f4'),
        *_string('texture_resource'),
        ('texture.stamp', '(2,)<i4'), *_string('texture.frame_id'), *_string('texture.format'),
        ('texture.data.size', '<u4'), ('uv_coordinates.size', '<u4'),
        *_string('text'), *_string('mesh_resource'), *_string('mesh_file.filename'),
        ('mesh_file.data.size', '<u4'), ('mesh_use_embedded_materials', 'u1'),
    ]
    return [(f'{namespace}_{name}', kind) for name, kind in fields]


def _header_of(sender: str, episode: bytes) -> list[_Field]:
    """Return the fields of a std_msgs/Header with frame_id `<sender>@<episode>`."""
    before = f'{sender}@'.encode()
    return [
        *_STAMP, ('frame_id.size', '<u4'), ('frame_id', f'S{len(before)}'),
        ('episode', f'({len(episode)},)u1'), ('frame_id.end', 'u1'),
    ]


def _string(name: str, text: str = '') -> tuple[_Field, _Field]:
    return (f'{name}.size', '<u4'), (name, f'S{len(text.encode()) + 1}')


def _layout(*fields: _Field) -> np.dtype:
    names, formats, offsets, end = [], [], [], _ENCAPSULATION
    for name, kind in fields:
        field = np.dtype(kind)
        if field.itemsize:  # an empty sequence adds no padding before the next field
            end += -(end - _ENCAPSULATION) % field.alignment
        names.append(name)
        formats.append(field)
        offsets.append(end)
        end += field.itemsize
    return np.dtype({'names': names, 'formats': formats, 'offsets': offsets, 'itemsize': end})


def place(layout: np.dtype, name: str) -> slice:
    """Return the slice of a message's bytes that holds a field."""
    assert layout.fields is not None
    kind, begin = layout.fields[name][:2]
    return slice(begin, begin + kind.itemsize)

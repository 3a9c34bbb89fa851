"""JSON schemas of messages: Foxglove's and ROS's names for what they show, and our own for arrays of numbers."""

from __future__ import annotations

from typing import Any

Schema = dict[str, Any]

_NUMBER: Schema = {"type": "number"}
_INTEGER: Schema = {"type": "integer"}
_TEXT: Schema = {"type": "string"}


def _object(**properties: Schema) -> Schema:
    return {"type": "object", "properties": properties}


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items}


_TIME = _object(sec=_INTEGER, nsec=_INTEGER)
_FRAME_TRANSFORM = _object(
    timestamp=_TIME,
    parent_frame_id=_TEXT,
    child_frame_id=_TEXT,
    translation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER),
    rotation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER),
)

#: Schemas by name.
SCHEMAS: dict[str, Schema] = {
    "foxglove.FrameTransforms": {"title": "foxglove.FrameTransforms", **_object(transforms=_list(_FRAME_TRANSFORM))},
    "foxglove.RawImage": {
        "title": "foxglove.RawImage",
        **_object(
            timestamp=_TIME,
            frame_id=_TEXT,
            width=_INTEGER,
            height=_INTEGER,
            encoding=_TEXT,
            step=_INTEGER,
            data={"type": "string", "contentEncoding": "base64"},
        ),
    },
    "sensor_msgs/msg/JointState": {
        "title": "sensor_msgs/msg/JointState",
        **_object(
            header=_object(stamp=_object(sec=_INTEGER, nanosec=_INTEGER), frame_id=_TEXT),
            name=_list(_TEXT),
            position=_list(_NUMBER),
            velocity=_list(_NUMBER),
            effort=_list(_NUMBER),
        ),
    },
    "tightloop.Values": {"title": "tightloop.Values", **_object(timestamp=_TIME, values=_list(_NUMBER))},
    "tightloop.Episode": {
        "title": "tightloop.Episode",
        **_object(timestamp=_TIME, index=_INTEGER, world=_INTEGER, steps=_INTEGER, ends={"type": "boolean"}),
    },
}

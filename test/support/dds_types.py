"""Messages of ROS 2 as an independent DDS implementation sees them, written from their definitions."""

from dataclasses import dataclass
from types import new_class

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, uint8, uint32


def _message(package: str, name: str, kind: str = "msg", /, **fields):
    """A type with the name that ROS 2 gives it on the wire."""
    body = {"__annotations__": fields, "__module__": __name__}
    return dataclass(
        new_class(name, (IdlStruct,), {"typename": f"{package}::{kind}::dds_::{name}_"}, lambda made: made.update(body))
    )


Time = _message("builtin_interfaces", "Time", sec=int32, nanosec=uint32)
Header = _message("std_msgs", "Header", stamp=Time, frame_id=str)
Point = _message("geometry_msgs", "Point", x=float64, y=float64, z=float64)
Quaternion = _message("geometry_msgs", "Quaternion", x=float64, y=float64, z=float64, w=float64)
Pose = _message("geometry_msgs", "Pose", position=Point, orientation=Quaternion)
PoseStamped = _message("geometry_msgs", "PoseStamped", header=Header, pose=Pose)
Vector3 = _message("geometry_msgs", "Vector3", x=float64, y=float64, z=float64)
Wrench = _message("geometry_msgs", "Wrench", force=Vector3, torque=Vector3)
WrenchStamped = _message("geometry_msgs", "WrenchStamped", header=Header, wrench=Wrench)
TriggerRequest = _message("std_srvs", "Trigger_Request", "srv", structure_needs_at_least_one_member=uint8)
TriggerResponse = _message("std_srvs", "Trigger_Response", "srv", success=bool, message=str)


def mistaken_pose(size: int):
    """A type that goes by the name of a stamped pose and holds so many bytes of anything."""
    return _message("geometry_msgs", "PoseStamped", octets=array[uint8, size])

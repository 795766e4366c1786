"""A program without ROS that talks to the node through Cyclone DDS: ``dds_client.py DOMAIN press|babble``."""

import os
import random
import struct
import sys
import time

# Heard on this machine only, as the node of the tests; set before it is read.
os.environ["CYCLONEDDS_URI"] = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>30</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from dds_types import (
    Header,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Time,
    TriggerRequest,
    TriggerResponse,
    WrenchStamped,
    mistaken_pose,
)

TOOL = "rt/sand_sim/tools/plate"
PATIENCE = 60.0
PLAIN = Policy.DataRepresentation(use_cdrv0_representation=True)
RELIABLE = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1000), PLAIN)
LOSSY = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1000), PLAIN)


def wait_for(condition):
    end = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < end, "nothing came of it"
        time.sleep(0.01)
    return found


def writer(participant, topic, kind):
    made = DataWriter(participant, Topic(participant, topic, kind), qos=RELIABLE)
    wait_for(made.get_matched_subscriptions)
    return made


def reader(participant, topic, kind, quality=RELIABLE):
    made = DataReader(participant, Topic(participant, topic, kind), qos=quality)
    wait_for(made.get_matched_publications)
    return made


def pose(height, at):
    stamp = Time(0, round(1e9 * at))
    return PoseStamped(Header(stamp, "world"), Pose(Point(0.015, 0.015, height), Quaternion(0.0, 0.0, 0.0, 1.0)))


def wrench_at(wrenches, at):
    """The force at a time [s], once it has come."""

    def look():
        return [one for one in wrenches.take(1000) if one.header.stamp.nanosec >= round(1e9 * at)]

    return wait_for(look)[-1].wrench.force.z


def press(participant):
    """Press the plate onto the bed, print what it feels, and take a step by service."""
    wrenches = [reader(participant, f"{TOOL}/wrench", WrenchStamped, quality) for quality in (RELIABLE, LOSSY)]
    answers = reader(participant, "rr/sand_sim/stepReply", TriggerResponse)
    questions = writer(participant, "rq/sand_sim/stepRequest", TriggerRequest)
    poses = writer(participant, f"{TOOL}/pose", PoseStamped)
    for height, at in ((0.06, 0.1), (0.0238, 0.5)):
        poses.write(pose(height, at))
    print(*(wrench_at(each, 0.4999) for each in wrenches))
    questions.write(TriggerRequest(0))
    (answer,) = wait_for(lambda: answers.take(1))
    assert answer.success, answer.message
    print(answer.message.split()[2])  # "t = 0.52 s"


def babble(domain):
    """Send bytes by the name of a stamped pose: anything at all, good poses cut off, and texts said to be far too long."""
    random.seed(1)
    good = struct.pack("<iII6s2x7d", 0, 0, 6, b"world\0", 0.015, 0.015, 0.05, 0.0, 0.0, 0.0, 1.0)
    for size in (1, 12, 24, len(good), 1000):
        participant = DomainParticipant(domain)  # of each a topic has one type
        kind = mistaken_pose(size)
        poses = writer(participant, f"{TOOL}/pose", kind)
        for length in (0, 5, 7, 10**6, 2**31, 2**32 - 1):
            body = bytearray((20 * good)[:size])
            body[8:12] = struct.pack("<I", length)
            for octets in (body[:size], random.randbytes(size)):
                poses.write(kind(list(octets)))
        time.sleep(0.1)


if __name__ == "__main__":
    number = int(sys.argv[1])
    if sys.argv[2] == "press":
        press(DomainParticipant(number))
    else:
        babble(number)

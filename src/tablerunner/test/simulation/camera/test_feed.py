from __future__ import annotations

from tablerunner.scenario import Camera, Marker, RobotGeometry, Scenario
from tablerunner.simulation import START_NS, Simulator
from tablerunner.types import ImageSample, Velocity

CAMERA = Camera((0.0, 0.0, 3.0), width=64, height=48, focal=(40.0, 40.0), delay=0.06, rate=10.0)


def simulator(camera: Camera | None) -> Simulator:
    robot = RobotGeometry(marker=Marker())
    return Simulator(Scenario('x', camera=camera, robot=robot, start=(0.0, 0.0, 0.0)), 3)


def test_picture_arrives_after_its_delay_with_the_stamp_of_its_exposure() -> None:
    sim, arrived = simulator(CAMERA), []
    for _ in range(100):
        arrived += [(sim.now_ns, s) for s in sim.step() if isinstance(s, ImageSample)]
    stamps = [image.stamp - START_NS for _, image in arrived]
    assert stamps == [100_000_000 * (index + 1) for index in range(9)]
    assert {now - image.stamp for now, image in arrived} == {60_000_000}


def test_camera_changes_nothing_that_other_sensors_say() -> None:
    """Each thing has its random stream: runs with and without a camera compare."""
    sims = [simulator(None), simulator(CAMERA)]
    for _ in range(60):
        samples = [
            [s for s in sim.step(Velocity(0.3, 0.2)) if not isinstance(s, ImageSample)]
            for sim in sims
        ]
        assert repr(samples[0]) == repr(samples[1])

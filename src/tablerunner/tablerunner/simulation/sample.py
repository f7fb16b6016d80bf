"""What comes out of a simulation step."""

from __future__ import annotations

from tablerunner.simulation.truth import Contact, RangeTruth, Truth
from tablerunner.types import (
    ExchangeSample,
    ImageSample,
    ImuSample,
    MagneticSample,
    Refusal,
    UltrasonicSample,
    WheelSample,
)

Sample = (
    WheelSample
    | ImuSample
    | MagneticSample
    | ExchangeSample
    | UltrasonicSample
    | ImageSample
    | Truth
    | RangeTruth
    | Contact
    | Refusal
)

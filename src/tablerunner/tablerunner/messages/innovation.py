"""What a measurement did to the estimate: tablerunner_interfaces/Innovation as Innovation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import Innovation


def innovation_from_message(message: Any) -> Innovation:
    """Return the innovation of a message; one without NIS never reached an estimator."""
    size = len(message.innovation)
    return Innovation(
        stamp=stamp_from_message(message.header.stamp),
        source=message.source,
        key=message.key,
        accepted=message.accepted,
        reason=message.reason,
        innovation=np.array(message.innovation, dtype=np.float64),
        covariance=np.array(message.variance, dtype=np.float64).reshape(
            (size, size) if len(message.variance) == size * size else (0, 0)
        ),
        nis=message.nis,
        gate=message.gate,
        considered=not math.isnan(message.nis),
    )

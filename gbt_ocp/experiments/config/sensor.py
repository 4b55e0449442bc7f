"""The section ``sensor``: when bearings are measured, and their faults."""

from __future__ import annotations

from gbt_ocp.experiments.config.keys import Section, key


class SensorSection(Section):
    """The bearing sensor (section 5.6)."""

    period_s: float = key(0.1, "T, sampling period in s.", gt=0.0)
    noise_deg: float = key(0.0, "Standard deviation of the bearing noise in degrees.", ge=0.0)
    missed_probability: float = key(0.0, "Probability that a bearing is missed.", ge=0.0, lt=1.0)
    outlier_deg: float = key(0.0, "Size of a sporadic outlier in degrees.", ge=0.0)
    outlier_every_s: float = key(10.0, "Time between outliers in s.", gt=0.0)
    latency_s: float = key(0.0, "Time in s from a measurement to its arrival at the tracker, which knows both.", ge=0.0)

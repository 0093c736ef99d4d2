"""Inputs of the room, as part of the state of the page: those of the sections, and which models are compared."""

from typing import Any, Literal

from pydantic import Field, create_model

from gmwm_jax.app.web.state import State
from nav_jax.app.web.controls import every


class Chosen(State):
    """Which truth, which filters, which trajectory and sensors, and what is sought."""

    nav_truth: Literal["sensor", "fit", "text"] = "sensor"
    nav_sensor: str = Field("mti-g", max_length=40, title="Sensor")
    nav_accel: str = Field("", max_length=300, title="Truth, accelerometers")
    nav_gyro: str = Field("", max_length=300, title="Truth, gyros")
    nav_rate: str = Field("100", max_length=30, title="Rate of the truth")
    nav_accel_bias: str = Field("", max_length=100, title="Turn-on bias of the accelerometers")
    nav_gyro_bias: str = Field("", max_length=100, title="Turn-on bias of the gyros")
    nav_right: bool = True
    nav_page: bool = True
    nav_uncalibrated: bool = True
    nav_structures: str = Field("WN", max_length=300, title="Other models, fitted to the same variances")
    nav_own_accel: str = Field("", max_length=300, title="A filter of your own, accelerometers")
    nav_own_gyro: str = Field("", max_length=300, title="A filter of your own, gyros")
    nav_motion: str = Field("lemniscate", max_length=40, title="Trajectory")
    nav_aiding: str = Field("gnss_position,gnss_velocity,barometer", max_length=200, title="Aiding")
    nav_of: str = Field("", max_length=100, title="Filter")
    nav_max_accel: int = Field(1, ge=0, le=2, title="Most Gauss-Markov processes of an accelerometer")
    nav_max_gyro: int = Field(1, ge=0, le=2, title="Most Gauss-Markov processes of a gyro")
    nav_outage_last: float = Field(15.0, gt=0, le=86_400, title="Length of an outage")
    nav_outage_every: float = Field(60.0, gt=0, le=86_400, title="An outage every")
    nav_outage_runs: int = Field(2, ge=1, le=20, title="Number of runs")
    nav_drive_filter: str = Field("", max_length=100, title="Filter of the drive")
    nav_drive_gate: float | None = Field(None, ge=0.5, lt=1, title="Gate")
    nav_drive_vibration: float | None = Field(None, ge=0, le=1e6, title="Noise of vibration")


_SECTIONS: dict[str, Any] = {c.name: (str, Field(c.default, max_length=200, title=c.label)) for c in every()}

NavigationState = create_model("NavigationState", __base__=Chosen, **_SECTIONS)
"""All of them: `Chosen`, and a text for each key of the sections."""

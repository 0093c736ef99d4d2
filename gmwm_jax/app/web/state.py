"""All inputs of the page but files, as one checked object: what a link holds."""

from collections.abc import Iterable
from typing import Any, Literal, TypeVar
from urllib.parse import urlencode

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

Source = Literal["published", "simulated", "public", "file", "saved"]
MAX_QUERY = 2000
"""Characters of a link."""

S = TypeVar("S", bound="State")


class State(BaseModel):
    """The inputs; each has a default and a range.

    Examples
    --------
    >>> from gmwm_jax.app.web.state import State
    >>> State(seed=3).to_query(), State.from_query({"seed": "3", "unknown": "x"}).seed
    ('seed=3', 3)
    """

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    room: str = Field("data", max_length=20)
    source: Source = "simulated"
    published: str = Field("mti-g", max_length=40)
    sensor: str = Field("mti-g", max_length=40)
    samples: int = Field(100_000, ge=1000, le=2_000_000, title="Samples")
    seed: int = Field(0, ge=0, le=2**31 - 1, title="Seed")
    own: str = Field("", max_length=300, title="A model of your own")
    """To be simulated in place of a sensor."""
    own_rate: float = Field(100.0, gt=0, le=1e6, title="Its sampling rate")
    own_unit: Literal["rad/s", "m/s^2"] = "rad/s"
    dataset: str = Field("", max_length=60)
    stored: str = Field("", max_length=200, title="Recording of the server")
    """A name, never a path."""
    rate: float | None = Field(None, gt=0, le=1e6, title="Sampling rate")
    units: str = Field("", max_length=100, title="Unit")
    time: str = Field("", max_length=100, title="Column of time")
    columns: str = Field("", max_length=200, title="Columns")
    delimiter: Literal["", ",", ";", "\t", " ", "|"] = ""
    header: int | None = Field(None, ge=0, le=1000, title="Line of names")
    gaps: Literal["refuse", "nan", "longest"] = "refuse"
    outliers: Literal["keep", "mask"] = "keep"
    channel: str = Field("", max_length=100)

    estimator: Literal["classic", "robust"] = "classic"
    efficiency: float = Field(0.6, ge=0.5, le=0.99, title="Efficiency")
    allan: bool = False
    in_samples: bool = False
    deviation: bool = False
    band: bool = True
    slopes: bool = False
    compare: bool = False
    every: bool = True
    unit: Literal["si", "deg_s", "deg_h"] = "si"
    datasheet: str = Field("", max_length=500, title="Datasheet")

    boxes: str = Field("WN", max_length=40)
    """Of processes, joined by commas."""
    more: str = Field("", max_length=80)
    """Of further processes, joined by commas."""
    gm: int = Field(1, ge=1, le=5, title="Number of GM")
    model: str = Field("", max_length=500, title="Model as text")
    """In place of the boxes."""
    hold: bool = False
    weights: Literal["default", "two-step", "covariance"] = "default"
    residuals: bool = True

    level: float = Field(0.95, ge=0.5, le=0.999, title="Confidence")
    replicates: int = Field(500, ge=20, le=5000, title="Replicates")
    route: Literal["variances", "records"] = "variances"
    draw_seed: int = Field(0, ge=0, le=2**31 - 1, title="Seed of the draws")
    superset: str = Field("QN + WN + RW + 2*GM", max_length=300, title="The largest model")

    nested: bool = True
    """Rank all parts of that model; or only the models in it, with semicolons between them."""
    tests: int = Field(200, ge=20, le=2000, title="Draws of the test")
    """Of near-stationarity."""

    target: str = Field("kalibr", max_length=20)
    value: float = Field(0.15, title="Value")
    unit_from: str = Field("deg/sqrt(h)", max_length=40, title="From")
    unit_to: str = Field("rad/s/sqrt(Hz)", max_length=40, title="To")
    process: Literal["WN", "RW", "DR", "QN", "GM"] = "WN"
    way: Literal["filter", "samples"] = "filter"
    numbers: str = Field("4.926494e-05", max_length=100, title="Its numbers")
    process_rate: float = Field(100.0, gt=0, le=1e6, title="Rate")
    signal: Literal["rad/s", "m/s^2"] = "rad/s"

    def to_query(self) -> str:
        """Write what differs from the defaults as the query of a link; empty where it would be too long."""
        given = self.model_dump(exclude_defaults=True, exclude_none=True)
        query = urlencode({k: int(v) if isinstance(v, bool) else v for k, v in given.items()})
        return query if len(query) <= MAX_QUERY else ""

    @classmethod
    def from_query(cls: type[S], query: Any) -> S:
        """Read a query: what is unknown or out of range is left out."""
        given: dict[str, Any] = {key: value for key, value in query.items() if key in cls.model_fields}
        while True:
            try:
                return cls(**given)
            except ValidationError as error:
                for found in error.errors():
                    given.pop(str(found["loc"][0]), None)

    @classmethod
    def checked(cls: type[S], given: dict[str, Any]) -> S:
        """Make a state of what the page says.

        Raises
        ------
        ValueError
            The first input that is out of range, by its label.
        """
        try:
            return cls(**given)
        except ValidationError as error:
            first = error.errors()[0]
            name = str(first["loc"][0])
            label = cls.model_fields[name].title or name if name in cls.model_fields else name
            reason = str(first["msg"]).replace("Input should be", "must be")
            raise ValueError(f"{label}: {reason}; it is {first.get('input')!r:.40}.") from None


def joined_state(states: Iterable[type[State]]) -> type[State]:
    """Make the state that has the inputs of all rooms.

    Examples
    --------
    >>> from gmwm_jax.app.web.state import State, joined_state
    >>> class Tides(State):
    ...     tides_height: float = 2.0
    >>> joined_state([State, Tides]).from_query({"tides_height": "3", "seed": "1"}).to_query()
    'seed=1&tides_height=3.0'
    """
    more = tuple(dict.fromkeys(state for state in states if state is not State))
    return create_model("JoinedState", __base__=more) if more else State

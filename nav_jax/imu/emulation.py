"""Errors of an IMU for many runs at once, sample by sample: drawn from a model, cut from a recording, or given.

The time loop asks for the errors of each covariance step when it comes to it. So a run of an hour needs no more memory
than one of a minute, and filters that are compared see the same numbers because they ask for the same ones.

Every state and every white part has a stream of random numbers of its own, named by channel and process. So the noise
of a run depends neither on the other runs, nor on the aiding, nor on how long the run goes on. (The length does enter
quantisation noise, which is drawn at once, and the place of a slice of a recording.)
"""

import zlib
from abc import abstractmethod
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Int, Key, UInt32

from nav_jax.imu._counter import counter_keys, normals
from nav_jax.imu.bank import SensorBank
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.noise_models import draw
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.kinematics.linalg import factor, root


class AbstractErrors(eqx.Module):
    """Errors of R runs over M segments of G covariance steps of n pieces; a sample may be several pieces."""

    per_step: eqx.AbstractVar[Any]
    """What `step` is given: arrays (M, G, ...)."""
    per_segment: eqx.AbstractVar[Any]
    """What `lasting` is given: arrays (M, ...)."""

    @abstractmethod
    def begin(self) -> Any:
        """What is carried from step to step."""

    @abstractmethod
    def step(self, carry: Any, ends: Float[Array, " n"], given: Any) -> tuple[Any, Float[Array, "n ch R"]]:
        """Errors that are added to the perfect sensors over a step; `ends` is 1 where a piece ends its sample."""

    @abstractmethod
    def lasting(self, carry: Any, given: Any) -> Float[Array, "ch R"]:
        """The part with a memory now: what filter states could estimate. NaN where nobody knows."""

    @abstractmethod
    def sample(self, carry: Any, given: Any) -> Float[Array, "ch R"]:
        """All errors of the sample that begins now, or goes on."""


class AtEnd(NamedTuple):
    """Errors at the end of each segment."""

    lasting: Float[Array, "M ch R"]
    sample: Float[Array, "M ch R"]


class GivenErrors(AbstractErrors):
    """Errors as arrays."""

    per_step: Float[Array, "M G n ch R"]
    per_segment: AtEnd

    def begin(self) -> None:
        """Nothing is carried."""

    def step(self, carry: None, ends: Float[Array, " n"], given: Float[Array, "n ch R"]) -> tuple[None, Array]:
        """Those given."""
        return carry, given

    def lasting(self, carry: None, given: AtEnd) -> Float[Array, "ch R"]:
        """Those given."""
        return given.lasting

    def sample(self, carry: None, given: AtEnd) -> Float[Array, "ch R"]:
        """Those given."""
        return given.sample


class Beside(NamedTuple):
    """What errors are made of besides states that have the same effect at all times."""

    stateless: Float[Array, "*M ch R"] | None
    """Errors of the processes without a state."""
    sensed: Float[Array, "*M ch"] | None
    """Perfect samples, where the effect of states depends on them."""


class DrawnErrors(AbstractErrors):
    """Errors drawn from a model."""

    bank: SensorBank
    gain: Float[Array, "S *S"]
    """Factor of the covariance of the states' noise: its diagonal where the bank is diagonal."""
    white: Float[Array, "ch 1"]
    x: Float[Array, "S R"]
    """States at the first sample."""
    total: Float[Array, "ch R"]
    """Errors of the first sample."""
    keys: UInt32[Array, "2 R"]
    per_step: "Beside"
    per_segment: "Beside"
    """Of the sample at the end of a segment."""
    streams: tuple[int, ...] = eqx.field(static=True)

    def begin(self) -> Any:
        """States and errors of a sample, its number, and the random numbers that lead to the next."""
        t = jnp.uint32(0)
        return self.x, self.total, t, self._normals(t)

    def _normals(self, t: UInt32[Array, ""]) -> Array:
        return normals(self.keys, np.array(self.streams, dtype=np.uint32), t)

    def step(self, carry: Any, ends: Float[Array, " n"], given: Beside) -> tuple[Any, Float[Array, "n ch R"]]:
        """Draw the next samples."""
        size = len(self.bank.states)

        def piece(carry, inputs):
            end, sensed = inputs
            # All is made a sample ahead: a carry is computed once, and not once in every expression that uses it.
            x, errors, t, e = carry
            noise = e.astype(x.dtype)
            driven = self.gain[:, None] * noise[:size] if self.bank.diagonal else self.gain @ noise[:size]
            x = self.bank.advance(x, end) + end * driven
            following = jnp.where(end > 0, self.bank.steady(x) + self.white * noise[size:], errors)
            t = t + end.astype(t.dtype)
            now = errors if sensed is None else errors + self.bank.changing(carry[0], sensed[:, None])
            return (x, following, t, self._normals(t)), now

        if len(ends) == 1:
            carry, errors = piece(carry, jax.tree.map(lambda a: a[0], (ends, given.sensed)))
            errors = errors[None]
        else:
            carry, errors = jax.lax.scan(piece, carry, (ends, given.sensed))
        return carry, errors if given.stateless is None else errors + given.stateless

    def lasting(self, carry: Any, given: Beside) -> Float[Array, "ch R"]:
        """Errors of the states."""
        return self.bank.errors(carry[0], None if given.sensed is None else given.sensed[:, None])

    def sample(self, carry: Any, given: Beside) -> Float[Array, "ch R"]:
        """Those of the carry."""
        errors = carry[1] if given.sensed is None else carry[1] + self.bank.changing(carry[0], given.sensed[:, None])
        return errors if given.stateless is None else errors + given.stateless


class SlicedErrors(AbstractErrors):
    """Errors cut from a recording."""

    record: Float[Array, "K ch"]
    first: Int[Array, " R"]
    """Sample of the recording at which each run starts."""
    per_step: None = None
    per_segment: None = None

    def begin(self) -> Array:
        """Number of the sample."""
        return jnp.zeros((), dtype=self.first.dtype)

    def step(self, carry: Array, ends: Float[Array, " n"], given: None) -> tuple[Array, Float[Array, "n ch R"]]:
        """The next samples."""
        after = carry + jnp.cumsum(ends).astype(carry.dtype)
        at = jnp.concatenate([carry[None], after[:-1]])
        errors = self.record.at[at[:, None] + self.first[None]].get(mode="clip")
        return after[-1], jnp.swapaxes(errors, 1, 2)

    def lasting(self, carry: Array, given: None) -> Float[Array, "ch R"]:
        """Nobody knows."""
        return jnp.full((len(CHANNELS), self.first.shape[0]), jnp.nan)

    def sample(self, carry: Array, given: None) -> Float[Array, "ch R"]:
        """That of the recording."""
        return self.record.at[carry + self.first].get(mode="clip").T


def stream(key: Key[Array, ""], name: str) -> Key[Array, ""]:
    """The key of a named stream of random numbers."""
    return jax.random.fold_in(key, _number(name))


def emulate(
    errors: ImuErrors | RecordedErrors,
    keys: Key[Array, " R"],
    num_samples: int,
    ends: Float[Array, "M G n"],
    sensed: tuple[Float[Array, "M G n ch"], Float[Array, "M ch"]] | None = None,
) -> AbstractErrors:
    """Errors of R runs of N samples.

    Parameters
    ----------
    errors
        The model, or a recording.
    keys
        One a run.
    num_samples
        N.
    ends
        1 where a piece ends its sample.
    sensed
        Perfect samples of the pieces, and at the ends of segments: for errors that depend on what is sensed.

    Raises
    ------
    ValueError
        A recording is shorter than N; errors depend on what is sensed, and that is not given.
    """
    if isinstance(errors, RecordedErrors):
        return _sliced(errors, keys, num_samples)
    bank = errors.bank()
    if bank.depends and sensed is None:
        raise ValueError("Scale factors and misalignments depend on what is sensed: give the perfect samples.")
    perfect = sensed if bank.depends and sensed is not None else (None, None)
    words = counter_keys(jax.vmap(lambda k: stream(k, "imu"))(keys))
    per_step, per_segment = _stateless(errors, keys, num_samples, ends)
    names = [str(state) for state in bank.states] + [f"{channel} white" for channel in CHANNELS]
    start = np.array([_number(f"{n} start") for n in names], dtype=np.uint32)
    deviation = normals(words, start, jnp.uint32(0)).astype(bank.initial.dtype)
    size, gain, white = len(bank.states), factor(bank.driving), root(bank.white)[:, None]
    x = factor(bank.initial) @ deviation[:size]
    return DrawnErrors(
        bank=bank,
        gain=jnp.diag(gain) if bank.diagonal else gain,
        white=white,
        x=x,
        total=bank.steady(x) + white * deviation[size:],
        keys=words,
        per_step=Beside(per_step, perfect[0]),
        per_segment=Beside(per_segment, perfect[1]),
        streams=tuple(_number(n) for n in names),
    )


def write_out(errors: AbstractErrors, ends: Float[Array, "M G n"]) -> GivenErrors:
    """The errors as arrays, to look at or to change; `ends` as in `emulate`."""

    def step(carry, given):
        return errors.step(carry, *given)

    def segment(carry, given):
        ends, per_step, per_segment = given
        carry, total = jax.lax.scan(step, carry, (ends, per_step))
        at_end = AtEnd(errors.lasting(carry, per_segment), errors.sample(carry, per_segment))
        return carry, (total, at_end)

    xs = (ends, errors.per_step, errors.per_segment)
    return GivenErrors(*jax.lax.scan(segment, errors.begin(), xs)[1])


def _number(name: str) -> int:
    return zlib.crc32(name.encode())


def _stateless(
    errors: ImuErrors, keys: Key[Array, " R"], num_samples: int, ends: Float[Array, "M G n"]
) -> tuple[Float[Array, "M G n ch R"], Float[Array, "M ch R"]] | tuple[None, None]:
    """Errors of the processes that have no state, drawn by themselves, of pieces and at ends; None if there is none."""
    models = [errors.stateless(channel) for channel in range(len(CHANNELS))]
    if all(m is None for m in models):
        return None, None
    total = jnp.zeros((num_samples, len(CHANNELS), keys.shape[0]))
    for channel, (name, model) in enumerate(zip(CHANNELS, models, strict=True)):
        if model is not None:
            streams = jax.vmap(lambda k, name=name: stream(k, f"imu {name} stateless"))(keys)
            total = total.at[:, channel].add(draw(model, num_samples, streams))
    sample = (jnp.cumsum(ends) - ends.ravel()).astype(int)
    pieces = total.at[sample].get(mode="clip").reshape(*ends.shape, *total.shape[1:])
    after = jnp.cumsum(ends.sum(axis=(1, 2))).astype(int)
    return pieces, total.at[after].get(mode="clip")


def _sliced(errors: RecordedErrors, keys: Key[Array, " R"], num_samples: int) -> SlicedErrors:
    spare = len(errors.record) - num_samples
    if spare < 0:
        raise ValueError(
            f"The recording has {len(errors.record)} samples at {errors.rate:g} Hz, and a run takes {num_samples}: "
            "use a longer recording or a shorter trajectory."
        )
    first = jax.vmap(lambda key: jax.random.randint(stream(key, "imu slice"), (), 0, spare + 1))(keys)
    return SlicedErrors(record=jnp.asarray(errors.record), first=first)

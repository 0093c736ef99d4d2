"""Errors of an IMU for many runs at once, sample by sample: drawn from a model, cut from a recording, or given.

The time loop asks for the errors of each covariance step when it comes to it. So a run of an hour needs no more memory
than one of a minute, and filters that are compared see the same numbers because they ask for the same ones.

Every state and every white part has random numbers of its own, named by channel and process. So the noise of a run
depends neither on the other runs, nor on the aiding, nor on how long the run goes on. (The length does enter
quantisation noise, which is drawn at once, and the place of a slice of a recording.) A stream has two numbers at a
time: one named by axis and process has one for the accelerometer and one for the gyro, whether both have that process
or not.
"""

import zlib
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Complex64, Float, Float32, Int, Key, UInt32

from nav_jax.imu._counter import counter_keys, normals
from nav_jax.imu.bank import SensorBank
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.noise_models import draw
from nav_jax.imu.output import Memory, Output
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.kinematics.linalg import factor, root
from nav_jax.kinematics.rotation import rotate_back


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

    def mean(self, carry: Any, given: Any, counts: Float[np.ndarray, " W"]) -> Float[Array, "W ch R"]:
        """Errors of means over so many samples about now: what lasts, and as much less of what does not."""
        lasting = self.lasting(carry, given)[None]
        return lasting + (self.sample(carry, given)[None] - lasting) / np.sqrt(counts)[:, None, None]


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


class Path(NamedTuple):
    """The true motion over samples, where errors depend on it."""

    distance: Float[Array, "*N"]
    """Travelled along the horizon, m."""
    quaternion: Float[Array, "*N 4"]
    """In the middle."""


class Beside(NamedTuple):
    """What errors are made of besides states that have the same effect at all times."""

    stateless: Float[Array, "*M ch R"] | None
    """Errors of the processes without a state."""
    sensed: Float[Array, "*M seen"] | None
    """Perfect samples, where the effect of states depends on them, and the temperature where it is known."""
    path: Path | None = None
    """Of the samples, where gravity has states."""


class Streams(NamedTuple):
    """Of the pairs of random numbers of a few streams, those that belong to S names."""

    numbers: tuple[int, ...]
    """Of the streams."""
    rows: tuple[int, ...]
    """Of each name, among the first numbers of all pairs and behind them the second."""

    @classmethod
    def of(cls, names: Sequence[str]) -> "Streams":
        """An accelerometer and a gyro with the same process on the same axis share a stream."""
        shared = [name.removeprefix("accel ").removeprefix("gyro ") for name in names]
        numbers = list(dict.fromkeys(_number(s) for s in shared))
        seconds = (len(numbers) if name.startswith("gyro ") else 0 for name in names)
        return cls(tuple(numbers), tuple(numbers.index(_number(s)) + k for s, k in zip(shared, seconds, strict=True)))

    def draw(self, keys: UInt32[Array, "2 R"], t: UInt32[Array, ""]) -> Complex64[Array, "streams R"]:
        """Number t of each stream."""
        return normals(keys, np.array(self.numbers, dtype=np.uint32), t)

    def of_names(self, pairs: Complex64[Array, "streams R"]) -> Float32[Array, "S R"]:
        """The number of each name."""
        return jnp.concatenate([pairs.real, pairs.imag])[np.array(self.rows)]


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
    streams: "Streams" = eqx.field(static=True)
    """Of the noise of all states, and behind it the white parts."""

    def begin(self) -> Any:
        """States and errors of a sample, its number, and the random numbers that lead to the next."""
        t = jnp.uint32(0)
        return self.x, self.total, t, self._normals(t)

    def _normals(self, t: UInt32[Array, ""]) -> Array:
        return self.streams.draw(self.keys, t)

    def step(self, carry: Any, ends: Float[Array, " n"], given: Beside) -> tuple[Any, Float[Array, "n ch R"]]:
        """Draw the next samples."""
        size = len(self.bank.states)

        def piece(carry, inputs):
            end, sensed, path = inputs
            # All is made a sample ahead: a carry is computed once, and not once in every expression that uses it.
            x, errors, t, e = carry
            noise = self.streams.of_names(e).astype(x.dtype)
            driven = self.gain[:, None] * noise[:size] if self.bank.diagonal else self.gain @ noise[:size]
            if path is None:
                x = self.bank.advance(x, end) + end * driven
            else:
                x = self.bank.advance(x, end, end * path.distance) + end * (driven + self._met(path, noise[:size]))
            following = jnp.where(end > 0, self.bank.steady(x) + self.white * noise[size:], errors)
            t = t + end.astype(t.dtype)
            now = errors if sensed is None else errors + self.bank.changing(carry[0], sensed[:, None])
            if path is not None:
                now = now.at[:3].add(self._weight(path, carry[0]))
            return (x, following, t, self._normals(t)), now

        if len(ends) == 1:
            carry, errors = piece(carry, jax.tree.map(lambda a: a[0], (ends, given.sensed, given.path)))
            errors = errors[None]
        else:
            carry, errors = jax.lax.scan(piece, carry, (ends, given.sensed, given.path))
        return carry, errors if given.stateless is None else errors + given.stateless

    def lasting(self, carry: Any, given: Beside) -> Float[Array, "ch R"]:
        """Errors of the states."""
        return self.bank.errors(carry[0], None if given.sensed is None else given.sensed[:, None])

    def sample(self, carry: Any, given: Beside) -> Float[Array, "ch R"]:
        """Those of the carry."""
        errors = carry[1] if given.sensed is None else carry[1] + self.bank.changing(carry[0], given.sensed[:, None])
        if given.path is not None:
            errors = errors.at[:3].add(self._weight(given.path, carry[0]))
        return errors if given.stateless is None else errors + given.stateless

    def _weight(self, path: Path, x: Array) -> Float[Array, "3 R"]:
        """What accelerometers feel of gravity that is larger by its states: less, along b."""
        return -rotate_back(path.quaternion[:, None], self.bank.gravity(x))

    def _met(self, path: Path, noise: Array) -> Array:
        """What drives states that fade with the distance, over a sample."""
        assert self.bank.travel is not None
        inverse, variance = self.bank.travel
        return root(-jnp.expm1(-2 * inverse * path.distance) * variance)[:, None] * noise


class SaidErrors(AbstractErrors):
    """Errors of what an IMU says: behind its output, which has a sample with its errors, less the perfect sample."""

    inner: AbstractErrors
    """Errors of what it senses."""
    output: Output
    first: Float[Array, "ch R"]
    """First sample, with these errors."""
    per_step: tuple[Any, Float[Array, "M G n ch"]]
    per_segment: tuple[Any, Float[Array, "M ch"]]
    """What the inner errors are given, and perfect samples."""
    rate: float = eqx.field(static=True)

    def begin(self) -> Any:
        """That of the inner errors, and the memory of the output."""
        return self.inner.begin(), self.output.begin(self.first, self.rate)

    def step(self, carry: Any, ends: Float[Array, " n"], given: Any) -> tuple[Any, Float[Array, "n ch R"]]:
        """The next samples, one after the other."""
        inner, memory = carry
        of_inner, sensed = given
        inner, errors = self.inner.step(inner, ends, of_inner)

        def piece(memory: Memory, inputs: Any) -> tuple[Memory, Array]:
            end, sensed, errors = inputs
            after, said = self.output.read(memory, sensed[:, None] + errors, self.rate)
            # a sample of which only a part is over is read again
            memory = jax.tree.map(lambda new, old: jnp.where(end > 0, new, old), after, memory)
            return memory, said - sensed[:, None]

        memory, said = jax.lax.scan(piece, memory, (ends, sensed, errors))
        return (inner, memory), said

    def lasting(self, carry: Any, given: Any) -> Float[Array, "ch R"]:
        """That of the inner errors."""
        return self.inner.lasting(carry[0], given[0])

    def sample(self, carry: Any, given: Any) -> Float[Array, "ch R"]:
        """What is said of the sample that begins now, less the perfect one."""
        of_inner, sensed = given
        errors = self.inner.sample(carry[0], of_inner)
        return self.output.read(carry[1], sensed[:, None] + errors, self.rate)[1] - sensed[:, None]


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

    def mean(self, carry: Array, given: None, counts: Float[np.ndarray, " W"]) -> Float[Array, "W ch R"]:
        """Those of the recording, in the middle of so many samples."""
        spans = [np.arange(round(n)) - round(n) // 2 for n in counts]
        found = (self.record.at[carry + self.first + s[:, None]].get(mode="clip").mean(axis=0).T for s in spans)
        return jnp.stack(list(found))


def stream(key: Key[Array, ""], name: str) -> Key[Array, ""]:
    """The key of a named stream of random numbers."""
    return jax.random.fold_in(key, _number(name))


def emulate(
    errors: ImuErrors | RecordedErrors,
    keys: Key[Array, " R"],
    num_samples: int,
    ends: Float[Array, "M G n"],
    sensed: tuple[Float[Array, "M G n seen"], Float[Array, "M seen"]] | None = None,
    path: Path | None = None,
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
        Perfect samples of the pieces, and at the ends of segments, with the temperature behind them where it is known:
        for errors that depend on them, and for an output.
    path
        The true motion over the N samples: for gravity that depends on where one is.

    Raises
    ------
    ValueError
        A recording is shorter than N; errors depend on what is sensed, or on the way, and that is not given.
    """
    if isinstance(errors, RecordedErrors):
        return _sliced(errors, keys, num_samples)
    if errors.output is not None:
        if sensed is None:
            raise ValueError("What an output does to a sample depends on what is sensed: give the perfect samples.")
        inner = emulate(errors.sensed, keys, num_samples, ends, sensed, path)
        of_pieces, at_ends = (a[..., : len(CHANNELS)] for a in sensed)
        return _said(inner, errors.output, errors.rate, ends, (of_pieces, at_ends))
    bank = errors.bank()
    if bank.depends and sensed is None:
        raise ValueError("Errors that are no noise depend on what is sensed: give the perfect samples.")
    if bank.travel is not None and path is None:
        raise ValueError("A disturbance of gravity depends on the way travelled: give the path.")
    perfect = sensed if bank.depends and sensed is not None else (None, None)
    paths = (None, None) if bank.travel is None or path is None else _along(path, ends)
    words = counter_keys(jax.vmap(lambda k: stream(k, "imu"))(keys))
    per_step, per_segment = _stateless(errors, keys, num_samples, ends)
    names = [str(state) for state in bank.states] + [f"{channel} white" for channel in CHANNELS]
    start = Streams.of([f"{n} start" for n in names])
    deviation = start.of_names(start.draw(words, jnp.uint32(0))).astype(bank.initial.dtype)
    size, white = len(bank.states), root(bank.white)[:, None]
    if bank.diagonal:
        gain, x = root(jnp.diag(bank.driving)), root(jnp.diag(bank.initial))[:, None] * deviation[:size]
    else:
        gain, x = factor(bank.driving), factor(bank.initial) @ deviation[:size]
    return DrawnErrors(
        bank=bank,
        gain=gain,
        white=white,
        x=x,
        total=bank.steady(x) + white * deviation[size:],
        keys=words,
        per_step=Beside(per_step, perfect[0], paths[0]),
        per_segment=Beside(per_segment, perfect[1], paths[1]),
        streams=Streams.of(names),
    )


def _said(
    inner: AbstractErrors,
    output: Output,
    rate: float,
    ends: Float[Array, "M G n"],
    sensed: tuple[Float[Array, "M G n ch"], Float[Array, "M ch"]],
) -> SaidErrors:
    """These errors behind an output."""
    _, errors = inner.step(inner.begin(), ends[0, 0], jax.tree.map(lambda a: a[0, 0], inner.per_step))
    return SaidErrors(
        inner=inner,
        output=output,
        first=sensed[0][0, 0, 0][:, None] + errors[0],
        per_step=(inner.per_step, sensed[0]),
        per_segment=(inner.per_segment, sensed[1]),
        rate=rate,
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


def _along(path: Path, ends: Float[Array, "M G n"]) -> tuple[Path, Path]:
    """The path of the sample of each piece, and of those that begin at the ends of segments, or go on there."""
    sample = (jnp.cumsum(ends) - ends.ravel()).astype(int).reshape(ends.shape)
    after = jnp.cumsum(ends.sum(axis=(1, 2))).astype(int)
    of_pieces, at_ends = (Path(*(a.at[at].get(mode="clip") for a in path)) for at in (sample, after))
    return of_pieces, at_ends


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

"""The Earth: what the mechanisation asks of it.

The frame n is fixed to the Earth: north, east and down at an origin, and straight axes from there, however far. In it
position, velocity and attitude of a body with specific force f and body rate omega in b follow

    p' = v,   v' = C f + g(p) - 2 w x v,   C' = C [omega x] - [w x] C

with gravity g, which contains the centrifugal acceleration and whose magnitude and direction go with the position, and
the rotation vector w of the Earth, which is constant in n (Groves 2013, sec. 5.5). This holds at every distance and on
every latitude; there is no transport rate. On a curved Earth the axes are level at the origin only.

The mechanisation, the perfect IMU, the truth and the error model ask the Earth of a scenario. `FlatEarth` answers with
constants, and says so: what is trivial is then not in the loops at all. `nav_jax.kinematics.wgs84` has the one that
turns and curves. One more Earth is one class derived from `AbstractEarth`.
"""

import abc
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from gmwm_jax._internal.checks import as_float, concrete, positive
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.typing import FloatLike, Scalar, Vector
from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.kinematics.rotation import matvec


class AbstractEarth(eqx.Module):
    """What mechanisation, error model and aiding sensors ask of an Earth, at a position in n, (3, ...) m."""

    is_uniform: eqx.AbstractClassVar[bool]
    """Whether gravity is the same everywhere."""
    is_turning: eqx.AbstractClassVar[bool]
    """Whether the rotation vector is not zero."""
    is_flat: eqx.AbstractClassVar[bool]
    """Whether the height is minus the third component of a position."""
    is_vast: ClassVar[bool] = False
    """Whether the gradient of gravity is the same for as far as a vehicle comes in a segment of a run, ten seconds at
    most: loops then ask for gravity and its gradient once a segment, and let covariances feel both and the rate so."""

    @abc.abstractmethod
    def gravity_n(self, position: Vector) -> Vector:
        """Gravity in n, centrifugal acceleration included, (3, ...) m/s^2."""

    @abc.abstractmethod
    def rate_n(self, position: Vector) -> Vector:
        """The rotation vector of the Earth, and so of n, in n, (3, ...) rad/s: the same at all positions."""

    def gradient_n(self, position: Vector) -> Float[Array, "3 3 ..."]:
        """Derivative of gravity by the position, component first, in 1/s^2; by that of `gravity_n` unless stated."""
        along = [jnp.zeros_like(position).at[i].set(1.0) for i in range(3)]
        return jnp.stack([jax.jvp(self.gravity_n, (position,), (e,))[1] for e in along], axis=1)

    @abc.abstractmethod
    def height(self, position: Vector) -> Float[Array, "..."]:
        """Height above the surface through the origin of n, (...) m."""

    def check(self, position: Float[np.ndarray, "N 3"], origin: Float[np.ndarray, "3"] | None) -> None:
        """Raise a ValueError where positions in n, which are about an origin if it is known, are none on this Earth."""
        del position, origin

    def local(self, position: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3 3"] | None:
        """The matrices that take vectors in n to the local north, east, down; None where errors are left in n."""
        del position
        return None


@saved()
class FlatEarth(AbstractEarth):
    """A flat Earth that does not rotate, with the same gravity everywhere.

    Parameters
    ----------
    gravity
        In m/s^2, along down.

    Raises
    ------
    ValueError
        Gravity is negative or not finite.

    Examples
    --------
    >>> float(nj.FlatEarth().gravity)
    9.80665
    """

    is_uniform: ClassVar[bool] = True
    is_turning: ClassVar[bool] = False
    is_flat: ClassVar[bool] = True

    gravity: Scalar

    def __init__(self, gravity: FloatLike = STANDARD_GRAVITY) -> None:
        positive("gravity", gravity, zero_ok=True)
        self.gravity = as_float(gravity)

    def gravity_n(self, position: Vector) -> Vector:  # noqa: D102
        zero = jnp.zeros_like(position[0])
        return jnp.stack([zero, zero, zero + self.gravity])

    def rate_n(self, position: Vector) -> Vector:  # noqa: D102
        return jnp.zeros_like(position)

    def height(self, position: Vector) -> Float[Array, "..."]:  # noqa: D102
        return -position[2]

    def __repr__(self) -> str:
        gravity = concrete(self.gravity)
        return f"FlatEarth(gravity={'traced' if gravity is None else f'{float(gravity):.9g}'})"


class Pull(NamedTuple):
    """Gravity around a position, of R runs."""

    gradient: Float[Array, "3 3 R"]
    """By the position, component first, in 1/s^2."""
    extended: Float[Array, "3 R"] | None
    """What gravity would be where positions are zero if the gradient were the same up to there, m/s^2; None where
    gravity is asked anew at every step."""


class EarthInLoops(eqx.Module):
    """An Earth as loops ask for it: what is constant is computed before them, and what is trivial is None."""

    earth: AbstractEarth
    constant: Float[Array, "3 1"] | None
    """Gravity, m/s^2, in n; None where it depends on the position."""
    rate: Float[Array, "3 1"] | None
    """Rotation vector, rad/s, in n; None where the Earth does not turn."""

    def __init__(self, earth: AbstractEarth) -> None:
        origin = jnp.zeros((3, 1))
        self.earth = earth
        self.constant = earth.gravity_n(origin) if earth.is_uniform else None
        self.rate = earth.rate_n(origin) if earth.is_turning else None

    @property
    def by_segment(self) -> bool:
        """Do errors feel the gradient of gravity and the rate once a segment, and not at every step?"""
        return self.earth.is_vast

    def gravity(
        self, position: Float[Array, "3 R"], velocity: Float[Array, "3 R"], dt: Float[Array, ""], pull: Pull | None
    ) -> Float[Array, "3 #R"]:
        """In n, in the middle of a step that begins there; of R runs, or one for all of them.

        The pull is that of a place near by, if it is known.
        """
        if self.constant is not None:
            return self.constant
        middle = position + dt / 2 * velocity
        if pull is None or pull.extended is None:
            return self.earth.gravity_n(middle)
        return pull.extended + matvec(pull.gradient, middle)

    def pull(self, position: Float[Array, "3 R"]) -> Pull | None:
        """Gravity around a position; None where it is the same everywhere."""
        if self.constant is not None:
            return None
        gradient = self.earth.gradient_n(position)
        extended = self.earth.gravity_n(position) - matvec(gradient, position) if self.earth.is_vast else None
        # computed once: XLA would put it into each of the products that it stands in
        return jax.lax.optimization_barrier(Pull(gradient, extended))

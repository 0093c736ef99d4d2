"""Type aliases shared by all files."""

from collections.abc import Sequence

from jax import Array
from jax.typing import ArrayLike
from jaxtyping import Float, Key

Scalar = Float[Array, ""]
PRNGKey = Key[Array, ""]
FloatLike = ArrayLike
Names = Sequence[str]

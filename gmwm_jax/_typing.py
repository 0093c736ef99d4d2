"""Type aliases shared by all files."""

from collections.abc import Sequence

import numpy as np
from jax import Array
from jax.typing import ArrayLike
from jaxtyping import Float, Key

Scalar = Float[Array, ""]
Scales = Float[Array, "J"] | Float[np.ndarray, "J"]
"""tau_j = 2^j, the spans of the Haar filters in samples."""
PRNGKey = Key[Array, ""]
FloatLike = ArrayLike
Names = Sequence[str]

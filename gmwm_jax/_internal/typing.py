"""Type aliases shared by all files of both packages."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from jax import Array
from jax.typing import ArrayLike
from jaxtyping import Float, Float64, Key
from numpy import ndarray

Scalar = Float[Array, ""]
PRNGKey = Key[Array, ""]
FloatLike = ArrayLike
Real = float | int
Names = Sequence[str]

if TYPE_CHECKING:
    Numbers = ndarray
else:
    Numbers = ndarray | Array  # what is read from a file is the first
"""NumPy's arrays, which inside of a transformation are traced: of that, who reads types hears nothing."""

Vector = Float[Array, "3 ..."]
"""Component axis first, then any axes: runs or times."""
Quaternion = Float[Array, "4 ..."]
Matrix = Float[Array, "3 3 ..."]

Times = Float64[ndarray, " epochs"]
Vectors = Float64[ndarray, "epochs 3"]
Quaternions = Float64[ndarray, "epochs 4"]

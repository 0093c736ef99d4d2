"""A recording in SI units: from files, arrays and named data sets, with its rate and names, outliers marked."""

from gmwm_jax.recordings import datasets as datasets
from gmwm_jax.recordings.files import read_recording as read_recording
from gmwm_jax.recordings.files import save_recording as save_recording
from gmwm_jax.recordings.outliers import OutlierRun as OutlierRun
from gmwm_jax.recordings.outliers import OutliersMasked as OutliersMasked
from gmwm_jax.recordings.outliers import mask_outliers as mask_outliers
from gmwm_jax.recordings.recording import Recording as Recording

"""Kalibr's ``imu.yaml``, and OpenVINS's ``kalibr_imu_chain.yaml``, which has the same numbers with intrinsics."""

from gmwm_jax.fitting.exports.noise import ImuNoise, comments, largest, real

_KEYS = (
    ("accelerometer", "accel", "m/s^2/sqrt(Hz)", "m/s^3/sqrt(Hz)"),
    ("gyroscope", "gyro", "rad/s/sqrt(Hz)", "rad/s^2/sqrt(Hz)"),
)


def kalibr(imu: ImuNoise) -> str:
    """Write Kalibr's file."""
    return "\n".join(
        [
            *comments(imu, "Kalibr, imu.yaml"),
            *_numbers(imu),
            "rostopic: /imu0  # yours",
            f"update_rate: {imu.rate!r}  # Hz",
            "",
        ]
    )


def openvins(imu: ImuNoise) -> str:
    """Write OpenVINS's file, with the intrinsics of a sensor without errors."""
    one, none = ([[float(i == j and on) for j in range(3)] for i in range(3)] for on in (True, False))
    matrices = {
        "T_i_b": [[float(i == j) for j in range(4)] for i in range(4)],
        "Tw": one, "R_IMUtoGYRO": one, "Ta": one, "R_IMUtoACC": one, "Tg": none,
    }  # fmt: skip
    lines = [
        *_numbers(imu),
        "rostopic: /imu0  # yours",
        "time_offset: 0.0  # yours",
        f"update_rate: {imu.rate!r}  # Hz",
        'model: "kalibr"',
    ]
    for key, rows in matrices.items():
        lines += [f"{key}:", *(f"  - {row}" for row in rows)]
    remark = "Matrices are those of a sensor without errors: put in yours."
    head = comments(imu, "OpenVINS, kalibr_imu_chain.yaml", remark)
    return "\n".join(["%YAML:1.0", *head, "imu0:", *(f"  {line}" for line in lines), ""])


def _numbers(imu: ImuNoise) -> list[str]:
    """The four lines that both have."""
    lines = []
    for key, sensor, density, walk in _KEYS:
        channels = getattr(imu, sensor)
        N, of_N = largest(channels, lambda c: c.filter.N)
        K, of_K = largest(channels, lambda c: c.filter.K)
        lines += [
            f"{key}_noise_density: {real(N)}  # {density}, {of_N}",
            f"{key}_random_walk: {real(K)}  # {walk}, {of_K}",
        ]
    return lines

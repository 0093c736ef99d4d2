"""IMUs by their public datasheets, from a phone's to that of an airliner: a row each, and what it leaves open stays so.

Where the range can be chosen, it is stated in the row, and the least significant bit is that of it. Numbers are of the
document that the row names, at room temperature; what it calls typical is ``typ``, and limits are ``max``. A density of
noise is taken as N, but where the total noise of the same sheet shows that it is one-sided.
"""

from collections.abc import Iterable, Iterator, Mapping

from gmwm_jax._internal.text_table import format_table
from nav_jax.imu.specification import ImuSpecification


class Devices(Mapping[str, ImuSpecification]):
    """Names of IMUs -> their datasheets; it prints itself as a table.

    Examples
    --------
    >>> len(nj.devices) >= 12
    True
    >>> print(nj.devices["HG1700 AG58"])
    HG1700 AG58, reads increments at 100 Hz
    ...
    """

    def __init__(self, rows: Iterable[ImuSpecification]):
        self._rows = {row.name: row for row in rows}

    def __getitem__(self, name: str) -> ImuSpecification:
        if name not in self._rows:
            raise KeyError(f"There is no datasheet of {name!r}; there are {', '.join(self._rows)}.")
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __repr__(self) -> str:
        head = ["device", "gyro N", "turn-on", "in-run", "accel N", "turn-on", "in-run"]
        entries = ("N", "turn_on_bias", "in_run_bias")
        rows = [[n, *(_first(s.get(e)) for s in (row.gyro, row.accel) for e in entries)] for n, row in self.items()]
        return format_table(head, rows, left=len(head))


def _first(texts: tuple[str, ...] | None) -> str:
    return "open" if texts is None else texts[0].partition(",")[0]


devices = Devices(
    [
        # -- consumer -------------------------------------------------------------------------------------------------
        ImuSpecification(
            name="MPU-6000",
            source="InvenSense, MPU-6000 and MPU-6050 Product Specification, PS-MPU-6000A-00 rev. 3.4 (2013), 6.1, 6.2",
            gyro={
                "N": "0.005 deg/s/sqrt(Hz), one-sided",
                "turn_on_bias": "20 deg/s, typ",
                "scale_factor": "3 %, max",
                "nonlinearity": "0.2 %, typ",
                "misalignment": "2 %, typ",
                "g_sensitivity": "0.1 deg/s/g, typ",
                "range": "2000 deg/s",
                "LSB": "1/16.4 deg/s",
            },
            accel={
                "N": "400 ug/sqrt(Hz), typ",
                "turn_on_bias": ("50 mg, typ", "50 mg, typ", "80 mg, typ"),
                "scale_factor": "3 %, typ",
                "nonlinearity": "0.5 %, typ",
                "misalignment": "2 %, typ",
                "scale_temperature": "0.02 %/K, typ",
                "range": "16 g",
                "LSB": "1/2048 g",
            },
        ),
        ImuSpecification(
            name="MPU-9250",
            source="InvenSense, MPU-9250 Product Specification, PS-MPU-9250A-01 rev. 1.0 (2014), tables 1, 2",
            gyro={
                "N": "0.01 deg/s/sqrt(Hz), one-sided",
                "turn_on_bias": "5 deg/s, typ",
                "scale_factor": "3 %, typ",
                "nonlinearity": "0.1 %, typ",
                "misalignment": "2 %, typ",
                "range": "2000 deg/s",
                "LSB": "1/16.4 deg/s",
            },
            accel={
                "N": "300 ug/sqrt(Hz), typ",
                "turn_on_bias": ("60 mg, typ", "60 mg, typ", "80 mg, typ"),
                "scale_factor": "3 %, typ",
                "nonlinearity": "0.5 %, typ",
                "misalignment": "2 %, typ",
                "bias_temperature": "1.5 mg/K, typ",
                "scale_temperature": "0.026 %/K, typ",
                "range": "16 g",
                "LSB": "1/2048 g",
            },
        ),
        ImuSpecification(
            name="ICM-20948",
            source="TDK InvenSense, ICM-20948 Datasheet, DS-000189 rev. 1.3 (2017), tables 1, 2 (board level)",
            gyro={
                "N": "0.015 deg/s/sqrt(Hz), typ",
                "turn_on_bias": "5 deg/s, typ",
                "scale_factor": "1.5 %, typ",
                "nonlinearity": "0.1 %, typ",
                "misalignment": "2 %, typ",
                "bias_temperature": "0.05 deg/s/K, typ",
                "range": "2000 deg/s",
                "LSB": "1/16.4 deg/s",
            },
            accel={
                "N": "230 ug/sqrt(Hz), typ",
                "turn_on_bias": "50 mg, typ",
                "scale_factor": "0.5 %, typ",
                "nonlinearity": "0.5 %, typ",
                "misalignment": "2 %, typ",
                "bias_temperature": "0.80 mg/K, typ",
                "scale_temperature": "0.026 %/K, typ",
                "range": "16 g",
                "LSB": "1/2048 g",
            },
        ),
        ImuSpecification(
            name="LSM6DSO",
            source="STMicroelectronics, LSM6DSO Datasheet, DS12140 rev. 2 (2019), table 2 (accelerometer at 2 g)",
            gyro={
                "N": "3.8 mdeg/s/sqrt(Hz), typ",
                "turn_on_bias": "1 deg/s, typ",
                "scale_factor": "1 %, typ",
                "bias_temperature": "0.01 deg/s/K, typ",
                "range": "2000 deg/s",
                "LSB": "70 mdeg/s",
            },
            accel={
                "N": "70 ug/sqrt(Hz), typ",
                "turn_on_bias": "20 mg, typ",
                "scale_factor": "1 %, typ",
                "bias_temperature": "0.1 mg/K, typ",
                "range": "2 g",
                "LSB": "0.061 mg",
            },
        ),
        ImuSpecification(
            name="ICM-42688-P",
            source="TDK InvenSense, ICM-42688-P Datasheet, DS-000347, features and tables 1, 2",
            gyro={
                "N": "2.8 mdeg/s/sqrt(Hz), typ",
                "turn_on_bias": "0.5 deg/s, typ",
                "scale_factor": "0.5 %, typ",
                "bias_temperature": "0.005 deg/s/K, typ",
                "range": "2000 deg/s",
                "LSB": "1/16.4 deg/s",
            },
            accel={
                "N": "70 ug/sqrt(Hz), typ",
                "turn_on_bias": "20 mg, typ",
                "scale_factor": "0.5 %, typ",
                "bias_temperature": "0.15 mg/K, typ",
                "range": "16 g",
                "LSB": "1/2048 g",
            },
        ),
        # -- industrial -----------------------------------------------------------------------------------------------
        ImuSpecification(
            name="ADIS16405",
            source="Analog Devices, ADIS16400/ADIS16405 Data Sheet rev. B (2009), table 1",
            rate="819.2 Hz",
            gyro={
                "N": "2.0 deg/sqrt(h), 1 sigma",
                "in_run_bias": "0.007 deg/s, 1 sigma",
                "turn_on_bias": "3 deg/s, 1 sigma",
                "scale_factor": "1 %, max",
                "nonlinearity": "0.1 %, typ",
                "misalignment": "0.05 deg, typ",
                "g_sensitivity": "0.05 deg/s/g, 1 sigma",
                "bias_temperature": "0.01 deg/s/K, typ",
                "scale_temperature": "40 ppm/K, typ",
                "range": "300 deg/s",
                "LSB": "0.05 deg/s",
                "bandwidth": "330 Hz",
            },
            accel={
                "N": "0.2 m/s/sqrt(h), 1 sigma",
                "in_run_bias": "0.2 mg, 1 sigma",
                "turn_on_bias": "50 mg, 1 sigma",
                "nonlinearity": "0.1 %, typ",
                "misalignment": "0.2 deg, typ",
                "bias_temperature": "0.3 mg/K, typ",
                "scale_temperature": "50 ppm/K, typ",
                "range": "18 g",
                "LSB": "3.33 mg",
                "bandwidth": "330 Hz",
            },
        ),
        ImuSpecification(
            name="ADIS16448",
            source="Analog Devices, ADIS16448 Data Sheet, table 1",
            rate="819.2 Hz",
            gyro={
                "N": "0.66 deg/sqrt(h), 1 sigma",
                "in_run_bias": "14.5 deg/h, 1 sigma",
                "turn_on_bias": "0.5 deg/s, 1 sigma",
                "scale_factor": "1 %, max",
                "nonlinearity": "0.1 %, typ",
                "misalignment": "0.05 deg, typ",
                "g_sensitivity": "0.015 deg/s/g, 1 sigma",
                "bias_temperature": "0.005 deg/s/K, 1 sigma",
                "range": "1000 deg/s",
                "LSB": "0.04 deg/s",
                "bandwidth": "330 Hz",
            },
            accel={
                "N": "0.11 m/s/sqrt(h), 1 sigma",
                "in_run_bias": "0.25 mg, 1 sigma",
                "turn_on_bias": "20 mg, 1 sigma",
                "misalignment": "0.2 deg, typ",
                "bias_temperature": "0.15 mg/K, 1 sigma",
                "range": "18 g",
                "LSB": "0.833 mg",
                "bandwidth": "330 Hz",
            },
        ),
        ImuSpecification(
            name="MTi-300",
            source="Movella (Xsens), MTi-300 data sheet (May 2023), all specifications typical",
            gyro={
                "N": "0.01 deg/s/sqrt(Hz), typ",
                "in_run_bias": "10 deg/h, typ",
                "g_sensitivity": "0.003 deg/s/g, typ",
                "range": "450 deg/s",
                "bandwidth": "415 Hz",
            },
            accel={
                "N": "60 ug/sqrt(Hz), typ",
                "in_run_bias": "15 ug, typ",
                "range": "20 g",
                "bandwidth": "375 Hz",
            },
        ),
        # -- tactical -------------------------------------------------------------------------------------------------
        ImuSpecification(
            name="ADIS16495-1",
            source="Analog Devices, ADIS16495 Data Sheet rev. C (2020), features and table 1 (ADIS16495-1)",
            rate="4250 Hz",
            gyro={
                "N": "0.09 deg/sqrt(h), 1 sigma",
                "in_run_bias": "0.8 deg/h, 1 sigma",
                "range": "125 deg/s",
                "LSB": "1/160 deg/s",
            },
            accel={
                "N": "0.008 m/s/sqrt(h), 1 sigma",
                "in_run_bias": "3.2 ug, 1 sigma",
                "range": "8 g",
                "LSB": "0.25 mg",
            },
        ),
        ImuSpecification(
            name="STIM300",
            source="Sensonor, STIM300 Datasheet TS1524 rev. 9, tables of gyro and 10 g accelerometer (g-compensated)",
            rate="2000 Hz",
            gyro={
                "N": "0.15 deg/sqrt(h), typ",
                "in_run_bias": "0.5 deg/h, typ",
                "scale_factor": "500 ppm, max",
                "nonlinearity": "25 ppm, typ",
                "misalignment": "1 mrad, typ",
                "g_sensitivity": "1 deg/h/g, typ",
                "range": "400 deg/s",
                "bandwidth": "262 Hz",
            },
            accel={
                "N": "0.06 m/s/sqrt(h), typ",
                "in_run_bias": "0.05 mg, typ",
                "turn_on_bias": "0.75 mg, typ",
                "scale_factor": "300 ppm, max",
                "nonlinearity": "100 ppm, typ",
                "misalignment": "1 mrad, typ",
                "range": "10 g",
                "bandwidth": "262 Hz",
            },
        ),
        ImuSpecification(
            name="HG4930 CA51",
            source="Honeywell, HG4930 MEMS Inertial Measurement Unit brochure, column CA51",
            gyro={
                "N": "0.04 deg/sqrt(h), typ",
                "in_run_bias": "0.25 deg/h, 1 sigma",
                "turn_on_bias": "7 deg/h, 1 sigma",
                "range": "400 deg/s",
            },
            accel={
                "N": "0.03 m/s/sqrt(h), typ",
                "in_run_bias": "0.025 mg, 1 sigma",
                "turn_on_bias": "1.7 mg, 1 sigma",
                "range": "20 g",
            },
        ),
        ImuSpecification(
            name="HG1700 AG58",
            source="Honeywell, HG1700 brochure N61-1619; NovAtel, UIMU-HG1700 and RAWIMU (scale factors, rate, ranges)",
            rate="100 Hz",
            reads="increments",
            gyro={
                "N": "0.125 deg/sqrt(h), max",
                "turn_on_bias": "1 deg/h, 1 sigma",
                "scale_factor": "150 ppm, 1 sigma",
                "range": "1000 deg/s",
                "LSB": "1/2^33 rad",
            },
            accel={
                "N": "0.065 ft/s/sqrt(h), max",
                "turn_on_bias": "1 mg, 1 sigma",
                "scale_factor": "300 ppm, 1 sigma",
                "range": "50 g",
                "LSB": "1/2^27 ft/s",
            },
        ),
        ImuSpecification(
            name="LN-200S",
            source="Northrop Grumman, LN-200S Inertial Measurement Unit data sheet; NovAtel, RAWIMU (scale factors)",
            reads="increments",
            gyro={
                "N": "0.07 deg/sqrt(h), 1 sigma",
                "turn_on_bias": "1 deg/h, 1 sigma",
                "scale_factor": "100 ppm, 1 sigma",
                "range": "1000 deg/s",
                "LSB": "1/2^19 rad",
            },
            accel={
                "N": "35 ug/sqrt(Hz), 1 sigma",
                "turn_on_bias": "300 ug, 1 sigma",
                "scale_factor": "300 ppm, 1 sigma",
                "range": "40 g",
                "LSB": "1/2^14 m/s",
            },
        ),
        # -- navigation -----------------------------------------------------------------------------------------------
        ImuSpecification(
            name="HG9900",
            source="Honeywell, HG9900 Inertial Measurement Unit brochure N61-1638",
            gyro={
                "N": "0.002 deg/sqrt(h), max",
                "turn_on_bias": "0.0035 deg/h, 1 sigma",
                "scale_factor": "5 ppm, 1 sigma",
            },
            accel={"turn_on_bias": "25 ug, 1 sigma", "scale_factor": "100 ppm, 1 sigma"},
        ),
    ]
)
"""All of them, by name."""

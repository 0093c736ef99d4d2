"""A campaign that is small: two scenarios, two filters, chunks of four runs. As a program: it runs into a store."""

import sys
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)  # workers import this file first

import nav_jax as nj  # noqa: E402

RATE = 20.0
RIGHT = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", RATE)
WHITE = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", RATE)
FILTERS = {"right": RIGHT, "white": WHITE}
KEY = 3


def scenarios():
    reference = nj.motions.lemniscate(4.0, RATE)
    start = nj.InitialUncertainty(0.1, 0.05, 0.005)
    gnss = nj.GnssPosition(horizontal=0.1, vertical=0.2, outages=[(1.5, 3.0)])
    return {"drive": nj.Scenario(reference, [gnss], start), "free": nj.Scenario(reference, (), start)}


def campaign(num_runs=12, **options):
    """Chunks of four runs; the first scenario alone unless `of` names others."""
    known = scenarios()
    chosen = {name: known[name] for name in options.pop("of", ("drive",))}
    options = {"key": jax.random.key(KEY), "chunk_size": 4, "truth": RIGHT, "filters": FILTERS} | options
    return nj.Campaign(chosen, num_runs=num_runs, **options)


def arrays_of(store):
    """Name -> bytes of all arrays that tasks write."""
    import zarr

    group = zarr.open_group(store, mode="r")["scenarios"]
    return {
        f"{scenario}/{name}": array[...].tobytes() for scenario, of in group.groups() for name, array in of.arrays()
    }


def files_of(store):
    """Path below the store -> content."""
    return {str(file.relative_to(store)): file.read_bytes() for file in Path(store).rglob("*") if file.is_file()}


def executor_of(workers):
    """Processes, threads where there are none, or those of a Dask cluster at an address."""
    if workers.startswith("tcp:"):
        from distributed import Client

        return Client(workers)
    return nj.campaign.processes(int(workers)) if int(workers) else None


if __name__ == "__main__":
    campaign(int(sys.argv[2])).run(sys.argv[1], executor=executor_of(sys.argv[3]))

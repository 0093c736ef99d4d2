"""Campaigns: Monte Carlo studies of many scenarios, filters and runs in a store that loses nothing.

```python
truth = nj.ImuErrors("WN(sigma2=6e-5) + RW(gamma2=1e-10)", "WN(sigma2=1.5e-6)", rate=20.0)
filters = {"right": truth, "white": nj.ImuErrors("WN(sigma2=6e-5)", "WN(sigma2=1.5e-6)", rate=20.0)}
scenario = nj.Scenario(nj.motions.circle(duration=20.0, rate=20.0), [nj.GnssPosition(horizontal=0.1, vertical=0.2)], every=10)
study = nj.Campaign({"drive": scenario}, truth, filters, key=jax.random.key(0), num_runs=32, chunk_size=16)
study.cost()  # before it begins
study.run("study.zarr")  # executor=nj.campaign.processes(4), or a Dask Client's; again after a crash: it continues
nj.Campaign.open("study.zarr").status()  # from anywhere, at any time
study.comparison("drive")  # the table of the filters
study.statistics("drive")["right"].mean_length["position"]  # at every epoch
```

A task is one chunk of the runs of one scenario. Its result depends on the specification of the campaign and on its
number, and on nothing else; it lies in one part of the store, with a checksum that is written last. Statistics are kept
for each chunk, and added in the order of chunks.

On a cluster with SLURM (extra ``cluster``) a job of its own, or a terminal that stays open, has the client and Dask's
scheduler; workers are jobs. They begin and end as the queue has it: what they finish is in the store, and the chunks in
flight are given to others. Where the job with the client ends, the same lines continue, with whatever workers there are.

```py
from dask.distributed import Client
from dask_jobqueue import SLURMCluster

prologue = [
    "export JAX_COMPILATION_CACHE_DIR=$HOME/.cache/jax",  # one worker compiles, the others read
    "export JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0",
    "export GMWM_JAX_NUM_THREADS=1",  # as many workers as cores
]
lifetime = ["--lifetime", "110m", "--lifetime-stagger", "5m"]  # below the walltime: workers end between two chunks
with SLURMCluster(
    cores=8, processes=8, memory="16GB", walltime="02:00:00", job_script_prologue=prologue, worker_extra_args=lifetime
) as cluster, Client(cluster) as client:
    cluster.adapt(maximum_jobs=20)
    study.run("study.zarr", executor=client, progress=True)
```

Where the queue has no room for a worker for a day, the client ends, and says so; another time stands in Dask's
configuration (``export DASK_DISTRIBUTED__SCHEDULER__NO_WORKERS_TIMEOUT="3 days"``). Workers of a `LocalCluster` are missed
after two minutes.

The store lies on a disk that client and workers see. ``nav-jax campaign spec.toml --store study.zarr --scheduler tcp://...``
does the same with a scheduler that runs. Without Dask, an array of jobs (``#SBATCH --array=0-9``) computes every tenth
chunk each, into stores of their own, which one more job gathers when they are done:

```py
k = int(os.environ["SLURM_ARRAY_TASK_ID"])
study.run(f"part_{k}.zarr", chunks=range(k, study.num_runs // 16, 10))  # 16 is the size of the chunks
```

```py
whole = nj.Campaign.merge(sorted(Path(".").glob("part_*.zarr")), into="whole.zarr")
whole.status()
```

Options of XLA, such as those of `nj.fast_loops`, are set for all jobs of a campaign (``export XLA_FLAGS=...``) or for none:
they change last bits, and a store that was begun with others warns of it.
"""  # noqa: E501

from gmwm_jax._internal.executors import processes as processes
from nav_jax.campaign.campaign import Campaign as Campaign
from nav_jax.campaign.results import CampaignStatus as CampaignStatus
from nav_jax.campaign.results import Cost as Cost
from nav_jax.campaign.results import Statistics as Statistics

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
"""  # noqa: E501

from nav_jax.campaign.campaign import Campaign as Campaign
from nav_jax.campaign.executors import processes as processes
from nav_jax.campaign.results import CampaignStatus as CampaignStatus
from nav_jax.campaign.results import Cost as Cost
from nav_jax.campaign.results import Statistics as Statistics

"""The command line ``gmwm-jax`` and its demonstration.

```console
$ gmwm-jax data simulate mti-g --samples 100000 --out imu.npz
$ gmwm-jax fit imu.npz --channels gyro_x,accel_x --model "WN + RW + GM" --plot fit.png --json fit.json
...
Datasheet units (at 100 Hz)
component  quantity   estimate  95 % low       high           unit
---------  --------  ---------  --------  ---------  -------------
WN         N            44.602         0     73.537    ug/sqrt(Hz)
RW         K            13.669     8.145      20.14  m/s/h/sqrt(h)
...
GMWM fits, parameters per sample
channel  unit   objective     search  p of fit   WN.sigma2   RW.gamma2  GM.beta  GM.variance
-------  -----  ---------  ---------  --------  ----------  ----------  -------  -----------
gyro_x   rad/s  0.5291314  converged    0.0032  1.3012e-05  2.3127e-11   1.7347   3.8279e-05
accel_x  m/s^2  0.3303232  converged     0.069  1.9132e-05  4.0046e-11   1.8347   6.3682e-05
```

A public recording, recognised by its content, needs neither rate nor unit; nor does a file of `save_recording`, or
one of a logger that is known. Others do:

```sh
gmwm-jax fit adis_16405_imu1.rda --channels all --model "WN + 2*GM + RW"
gmwm-jax wv static.csv --time time --units "gyro=deg/s,accel=g" --allan --plot allan.png
gmwm-jax wv static.csv --time time --units "gyro=deg/s,accel=g" --hadamard --plot hadamard.png
gmwm-jax wv logger.npy --rate 200 --units deg/s --modified-allan --json -
gmwm-jax wv MT_0312.txt.gz --gaps nan
gmwm-jax wv run.bag --variable /imu/data --channels gyro
gmwm-jax wv imu.txt --format kf-gins
gmwm-jax wv span.asc --scale adis16488
gmwm-jax wv counts.csv --time t_ms --scale "gyro=0.1 deg/s,accel=1.25 mg"
```

What was understood (format, rate, jitter, missing samples, columns, units) is said on standard error. A file whose
columns have no names is read by `--columns 1,2,3`; every option of `read_recording` is there, by its name.

Which model, and how sure? `select` ranks all sub-models; `fit` takes replicates, other weights, and a wavelet variance
that gives outliers no weight:

```sh
gmwm-jax select imu.npz --channels accel_x --model "WN + QN + RW + 2*GM" --plot selection.png
gmwm-jax fit imu.npz --channels accel_x --model "WN + RW + GM" --weights covariance --bootstrap 500 --robust
```

The parameter files of other filters, whose comments say units, rate and what was left out:

```sh
gmwm-jax fit imu.npz --model "WN + RW + GM" --export kalibr=imu.yaml --export px4=ekf2.params --export nav-jax=fit.json
```

All of this is a page in the browser, too: ``gmwm-jax app`` serves it on this machine alone (extra ``web``), and Ctrl-C
ends it. How others come to see it is said at the end.

Units, without any data:

```console
$ gmwm-jax units 0.15 "deg/sqrt(h)" "rad/s/sqrt(Hz)"
0.15 deg/sqrt(h) = 4.36332313e-05 rad/s/sqrt(Hz)
$ gmwm-jax units --model "GM(beta=0.001, variance=1e-7)" --rate 100
GM(beta=0.001, variance=1e-07)  (per sample at 100 Hz)

Continuous time, SI (at 100 Hz)
component  quantity  estimate         unit
---------  --------  --------  -----------
GM         beta           0.1          1/s
GM         q            2e-08  (rad/s)^2/s
...
$ gmwm-jax units --datasheet "N=0.15 deg/sqrt(h), K=2 deg/h/sqrt(h)" --rate 400
WN(sigma2=7.61544e-07) + RW(gamma2=6.52901e-17)  (per sample at 400 Hz)
...
```

On a lab server behind a proxy
------------------------------

The page has no login and no encryption: whoever reaches it may use it. So leave it at 127.0.0.1, where only the server
itself reaches it, and let a proxy do both, under the name that people type:

```sh
gmwm-jax app --no-browser --port 8000 --name lab.example.org --root-path /noise --data-dir /srv/recordings
```

``--name`` is the name that the proxy is called by, and passes on: requests to other names, and sockets that another
page opens, are refused. ``--root-path`` is the path under which it stands, if that is not the top; the proxy takes it
away. The page is one connection that stays open (a WebSocket), so that the proxy has to hand it on and be patient.

nginx, with passwords of its own:

```nginx
server {
    listen 443 ssl;
    server_name lab.example.org;
    ssl_certificate     /etc/ssl/lab.pem;
    ssl_certificate_key /etc/ssl/lab.key;
    location /noise/ {
        auth_basic           "lab";
        auth_basic_user_file /etc/nginx/lab.passwords;
        proxy_pass           http://127.0.0.1:8000/;   # the last slash takes /noise away
        proxy_http_version   1.1;
        proxy_set_header     Host $http_host;
        proxy_set_header     Upgrade $http_upgrade;
        proxy_set_header     Connection "upgrade";
        proxy_read_timeout   1h;
        client_max_body_size 100m;                     # as --max-upload
        proxy_request_buffering off;
    }
}
```

Caddy, which keeps the name, hands sockets on and fetches its certificate by itself:

```
lab.example.org {
    basic_auth {
        somebody HASH-OF-caddy-hash-password
    }
    handle_path /noise/* {
        reverse_proxy 127.0.0.1:8000
    }
}
```

What one page may ask for, so that it does not hold the others up:

- 20 pages at a time, each closed after 30 minutes of silence;
- files of 100 MB (``--max-upload``), 1 GB a page, read in a process of 4 GB within 120 s;
- one computation of a page at a time, ``--workers`` in all, 180 s each;
- replicates, rankings and campaigns one after the other, 10 minutes each; what is done by then is kept;
- 12 channels, models of 8 processes and 5 GM.

A limit of memory by the operating system (``systemd-run -p MemoryMax=8G``) is a good idea nevertheless.

``--data-dir`` shows the files of a folder by name, so that nobody sends them; nothing else on the server can be named.
What was sent lies in a temporary folder that its owner alone reads, and goes when the page is closed; of a server that
was killed, at the next start. Compiled models are kept in the owner's folder of caches, readable by nobody else, unless
``--no-cache``. A link holds the inputs, not the data, so that after a restart a page is opened again where it was.
"""

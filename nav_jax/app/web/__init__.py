"""The room Navigation of the page of ``gmwm-jax app``: what the models of the page do to a filter.

What the page shows is a comparison as a configuration file has it: `controls` makes the inputs of the sections of such
a file, `study` the file of the inputs and what it states, `models` the noise of the fits of the page. `figures` and
`tables` make what is seen, `files` what is taken away; all of these are pure functions, and `room` knows the page.
"""

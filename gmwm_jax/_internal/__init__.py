"""What both packages need and users do not: checks, atomic files, tables of text and of numbers, progress, drawing.

No promise is made for any of it: import it from nowhere but gmwm_jax and nav_jax.
"""

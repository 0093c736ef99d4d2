"""Steps of the tutorial that are done in this room."""

from gmwm_jax.app.web.rooms.room import Step

STEPS: tuple[Step, ...] = ()

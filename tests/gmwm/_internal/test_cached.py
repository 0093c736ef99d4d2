"""Two threads that compute the same property of two objects do not wait for each other."""

import threading

from gmwm_jax._internal.cached import cached_property


class Slow:
    def __init__(self, meets):
        self.meets, self.computed = meets, 0

    @cached_property
    def value(self):
        self.computed += 1
        self.meets.wait(10)  # for the other one, which a lock of the class would keep out
        return object()


def test_objects_do_not_wait_for_each_other():
    meets = threading.Barrier(2)
    both = [Slow(meets), Slow(meets)]
    threads = [threading.Thread(target=lambda one=one: one.value) for one in both]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    assert not meets.broken
    assert [one.computed for one in both] == [1, 1]
    assert both[0].value is both[0].value
    assert both[0].computed == 1


def test_of_one_object_all_get_the_same():
    meets = threading.Barrier(2)
    one, found = Slow(meets), []
    threads = [threading.Thread(target=lambda: found.append(one.value)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    assert found[0] is found[1]

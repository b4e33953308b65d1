"""What is said of a name that nobody knows."""

import pytest

from rig_nodes.config.names import unknown

TOPICS = ("/motor/m_wej", "/motor/state", "/gearbox/state")


@pytest.mark.parametrize("name, known, sentence", [
    ("n_wei", ("n_wyj", "m_wej", "n_wej", "p1"), "there is no signal 'n_wei'; did you mean 'n_wej' or 'n_wyj'?"),
    ("N_WEJ", ("n_wej", "p1"), "there is no signal 'N_WEJ'; did you mean 'n_wej'?"),
    ("m_wej", TOPICS, "there is no signal 'm_wej'; did you mean '/motor/m_wej'?"),
    ("zzz", ("n_wej", "p1"), "there is no signal 'zzz'; known are n_wej, p1"),
    ("x", (), "there is no signal 'x'; there is none at all"),
    (3, (1, 2), "there is no signal '3'; known are 1, 2"),
])
def test_the_name_most_like_it_is_proposed_else_all_are_named(name, known, sentence):
    assert unknown("signal", name, known) == sentence

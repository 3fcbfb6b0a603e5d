"""Parts of a model print as the calls that make them, without defaults."""

from __future__ import annotations

import hybridsim as hs


def test_a_part_prints_what_was_declared() -> None:
    assert repr(hs.State("x", 1, "-k*x", unit="m")) == "State(name='x', start='1', der='-k*x', unit='m')"
    assert repr(hs.Parameter("k", 2.5)) == "Parameter(name='k', value='2.5')"
    assert repr(hs.Impact("p", gap="h", restitution="e")) == "Impact(name='p', gap='h', restitution='e')"
    signal = hs.Input("u", "table", times=[0, 1], values=[2, 3])
    assert (
        repr(signal)
        == "Input(name='u', kind='table', times=(0.0, 1.0), values=(2.0, 3.0), interpolation='linear')"
    )


def test_the_text_of_a_contact_is_the_call_that_makes_it() -> None:
    contact = hs.Contact(
        "f", velocity="v - 1", normal="2*N", law="static-kinetic", arguments={"mu_s": 0.5, "mu_k": "m"}
    )
    assert repr(contact).startswith(
        "Contact(name='f', velocity='v - 1', normal='2*N', law=FrictionLaw(name='static-kinetic'"
    )
    assert repr(contact).endswith("arguments={'mu_s': '0.5', 'mu_k': 'm'})") and "None)" not in repr(contact)
    # a part that differs in one argument differs in its text
    assert repr(contact) != repr(
        hs.Contact("f", "v - 1", "2*N", "static-kinetic", {"mu_s": 0.4, "mu_k": "m"})
    )


def test_events_of_a_mechanical_system_print_the_first_ones() -> None:
    sol = hs.simulate(hs.two_blocks_on_belt(), (0, 5))
    text = repr(sol.events)
    assert text.startswith(f"<{len(sol.events)} events: <transition ") and text.count("at t = ") == min(
        5, len(sol.events)
    )
    assert repr(sol.events[0]) in text

"""Coulomb friction from a row of a table."""

from colloc import Friction


def coulomb(mu_t, mu_f, mu_b):
    return Friction(mu_t=mu_t, mu_f=mu_f, mu_b=mu_b)

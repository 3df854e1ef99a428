"""What small changes of pose and motion do to loops and balance."""

from estimator.arrays import Array
from estimator.estimate.principal import inertia_matrix
from estimator.so3 import cross


def needed_wrench(
    motion: Array, twist: Array, twist_dot: Array, gravity: Array, pi: Array
) -> tuple[Array, Array]:
    """Force and moment that a change of the payload's motion asks for, in {1}, shape (..., 3) each.

    Args:
        motion: its twist, shape (Q, 6).
        twist, twist_dot: changes of its twist, and of that one's rate, shape (..., Q, 6).
        gravity: change of the vertical times gravity [m/s^2], shape (..., Q, 3).
        pi: its inertial parameters (m, m c, J about {1}), shape (10,).
    """
    mass, mass_c, inertia = pi[0], pi[1:4], inertia_matrix(pi[4:])
    omega, v = motion[:, :3], motion[:, 3:]
    d_omega, d_alpha = twist[..., :3], twist_dot[..., :3]
    accel = twist_dot[..., 3:] + cross(d_omega, v) + cross(omega, twist[..., 3:]) + gravity
    force = mass * accel + cross(d_alpha, mass_c)
    force += cross(d_omega, cross(omega, mass_c)) + cross(omega, cross(d_omega, mass_c))
    moment = cross(mass_c, accel) + d_alpha @ inertia
    return force, moment + cross(d_omega, omega @ inertia) + cross(omega, d_omega @ inertia)


def vee(A: Array) -> Array:
    """Vector of the skew part of matrices, shapes (..., 3, 3) -> (..., 3)."""
    low, high = A[..., (2, 0, 1), (1, 2, 0)], A[..., (1, 2, 0), (2, 0, 1)]
    return 0.5 * (low - high)

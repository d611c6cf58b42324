"""Why Newton's method may stop converging while a gel swells freely: three discretisations of one model.

Variants (`variants`): `present` (`Concentration` as it is), and made here `smooth` (the smooth p in the momentum balance in
place of the pressure of local Donnan equilibrium), `elementwise` (smooth p, and the charge at the point with its elementwise
gradient, from second derivatives of u, in fluxes and baths: no charge field), `elementwise_pointwise` (the same with the
present pressure). The runs also have `potential`, the toolkit's default model with exact baths.

First a gel of Table 2 held sideways, its surface free of stress: F = diag(1, J) (`spectra`). Then such a gel at rest,
disturbed (`disturbance`). Last the free-swelling scene from its state at 7000 s (`passages`). Numbers, V a variant, N the
cells a side, each of 0.05 mm:

- `V_eigenvalue_N_J_...`: smallest eigenvalue of the momentum's tangent on displacements that move no fluid as far as the
  discrete p can see, in units of µ |Grad v|², at that J; `V_negative_N_J_...`: how many are negative;
- `V_critical_J_N`: where the smallest passes zero; closed forms for the surface of a half-space: `biot_critical_J`
  (incompressible), `solid_critical_J` (the solid's bulk stiffness alone), `drained_critical_J` (at rest with its bath);
- `V_held_eigenvalue_N`: the smallest at J = 3 with the surface held: the control, positive;
- `V_growth_N_bath_C`: fastest growth rate [1/s] of small perturbations at rest in C mol/l, `V_growing_N_bath_C`: how many;
- `V_measured_growth`: rate [1/s] at which the disturbed gel (4 × 4, 0.1 mol/l, steps of 1 ms) leaves its state of rest;
  `V_disturbance_STEP`: its amplitude at the end [mm], from 1e-8, with steps of `ms` (0.06 s) or `s` (60 s);
- `runs_passed`, `runs_failed`; per run (VARIANT_MESH_STEP, `_undamped`, `_disturbed` where so) `..._reached_s`,
  `..._wanted_s`, `..._first_rejection_s` (−1: none), `..._failed_solves`, `..._iterations` and, of the last failed solve,
  `..._field`, `..._x_mm`, `..._y_mm`, `..._reason`. A run is given up after 24 failed solves.
"""

from studies.limits.convergence.study import run

__all__ = ["run"]

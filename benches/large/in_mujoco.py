# The scene of `cargo bench --bench large -- flat` by MuJoCo (pip install mujoco): a slab of tetrahedra, flexible, that
# falls on a flat floor. One thread. Contact of MuJoCo is soft and damped by default.
#
#   python benches/large/in_mujoco.py [cells a side]…
import sys
import time

import mujoco
import numpy as np

SPEED = 0.01


def run(cells, h):
    layers = -(-3 * cells // 10)
    model = mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <option timestep="{h}" gravity="0 0 0" integrator="discrete"/>
  <size memory="8G"/>
  <worldbody>
    <geom type="plane" size="0 0 1" condim="1"/>
    <flexcomp name="slab" type="grid" dim="3" count="{cells + 1} {cells + 1} {layers + 1}" spacing="1 1 1"
              pos="0 0 {layers / 2 + 1.5 * SPEED * h}" radius="1e-6" mass="1">
      <elasticity young="1" poisson="0"/>
      <contact selfcollide="none" condim="1"/>
    </flexcomp>
  </worldbody>
</mujoco>""")
    data = mujoco.MjData(model)
    # MuJoCo gives all nodes the same mass: in the place of it the mass of the cells around each.
    mujoco.mj_forward(model, data)
    nodes = model.flex_vertbodyid
    places = np.rint(data.xpos[nodes] - data.xpos[nodes].min(axis=0)).astype(int)
    shares = [np.r_[0.5, np.ones(count - 1), 0.5] for count in (cells, cells, layers)]
    mass = np.prod([share[places[:, axis]] for axis, share in enumerate(shares)], axis=0)
    model.body_mass[nodes] = mass
    mujoco.mj_setConst(model, data)
    data.qvel[2::3] = -SPEED

    times, forces, last = [[], []], [], -SPEED * mass.sum()
    for _ in range(round(3 * layers / h)):
        start = time.perf_counter()
        mujoco.mj_step(model, data)
        times[data.ncon > 0].append(time.perf_counter() - start)
        now = mass @ data.qvel[2::3]
        forces.append((now - last) / (h * SPEED * cells**2))
        last = now
    forces = np.array([force for force in forces if abs(force) > 0.01])
    print(
        f"{model.nv:8} {h:8} {np.median(times[0]):8.4f} {np.median(times[1]):8.4f} "
        f"{last / (SPEED * mass.sum()):8.3f} {forces.mean():11.3f} {forces.max():14.3f}",
        flush=True,
    )


print(f"MuJoCo {mujoco.__version__}")
print("    dofs  Courant  open, s  step, s  rebound  mean force  largest force")
for cells in [int(word) for word in sys.argv[1:]] or [10, 20]:
    for h in [0.1, 1.0]:
        run(cells, h)

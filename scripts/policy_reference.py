#!/usr/bin/env python3
"""Makes and checks the files by which the crate `policy` is compared with robomimic and PyTorch.

    pip install torch h5py tqdm termcolor psutil tensorboardX imageio matplotlib; pip install --no-deps robomimic
    (any environment; nothing of the build needs it)

    scripts/policy_reference.py hdf5 OUT.hdf5          a file laid out as robomimic does: crates/policy/tests/data/robomimic.hdf5
    scripts/policy_reference.py sequences DEMOS.hdf5   reads a file of ours with robomimic's own SequenceDataset
"""

import json
import sys


def write_hdf5(path):
    """Two demonstrations with a gap in their numbers, f64 actions, f32 states, integer dones, pictures."""
    import h5py
    import numpy as np

    with h5py.File(path, "w") as f:
        data = f.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_name": "Lift", "type": 1, "env_kwargs": {}}, indent=4)
        data.attrs["total"] = 6
        for name in ["demo_0", "demo_2"]:
            demo = data.create_group(name)
            demo.attrs["num_samples"] = 3
            actions = np.zeros((3, 7))
            actions[1] = [0.25, -0.5, 0, 0, 0, 0, 1]
            demo.create_dataset("actions", data=actions)
            demo.create_dataset("states", data=np.array([[0.5, 0.1], [1.5, 0.1], [2.5, 0.1]], dtype=np.float32))
            demo.create_dataset("rewards", data=np.array([0.0, 0.0, 1.0]))
            demo.create_dataset("dones", data=np.array([0, 0, 1]))
            demo.create_dataset("obs/object", data=np.array([[0, 0.5], [1, 1.5], [2, 2.5]]), compression="gzip")
            demo.create_dataset("obs/agentview_image", data=np.zeros((3, 4, 4, 3), dtype=np.uint8))
        f.create_dataset("mask/train", data=np.array(["demo_0"], dtype="S"))
        f.create_dataset("mask/valid", data=np.array(["demo_2"], dtype="S"))


def read_sequences(path):
    """Prints what robomimic's loader makes of the first windows: it must not fail, and the end must be padded."""
    import h5py
    import numpy as np
    import robomimic.utils.obs_utils as obs_utils
    from robomimic.utils.dataset import SequenceDataset

    with h5py.File(path) as f:
        keys = list(f["data/demo_0/obs"].keys())
        total, masks = f["data"].attrs["total"], list(f.get("mask", {}).keys())
        lengths = {k: len(f["data"][k]["actions"]) for k in f["data"]}
    obs_utils.initialize_obs_utils_with_obs_specs({"obs": {"low_dim": keys}})
    for mask in masks + [None]:
        s = SequenceDataset(path, keys, ["actions", "rewards", "dones"], load_next_obs=True, frame_stack=1, seq_length=10,
                            pad_frame_stack=True, pad_seq_length=True, get_pad_mask=False, hdf5_cache_mode="all",
                            hdf5_use_swmr=False, filter_by_attribute=mask)
        end = s[lengths[s.demos[0]] - 1]
        assert np.all(end["actions"] == end["actions"][0]), "the end is not padded by repeating"
        print(f"mask {mask}: {len(s)} windows of {len(s.demos)} demonstrations;",
              {k: v.shape for k, v in end["obs"].items()}, end["actions"].shape)
    assert len(s) == total == sum(lengths.values())


if __name__ == "__main__":
    verbs = {"hdf5": write_hdf5, "sequences": read_sequences}
    if len(sys.argv) < 3 or sys.argv[1] not in verbs:
        sys.exit(__doc__)
    verbs[sys.argv[1]](*sys.argv[2:])

#!/usr/bin/env python3
"""Makes and checks the files by which the crate `policy` is compared with robomimic and PyTorch.

    pip install torch torchvision safetensors six h5py tqdm termcolor psutil tensorboardX imageio matplotlib; pip install --no-deps robomimic
    (any environment; nothing of the build needs it)

    scripts/policy_reference.py hdf5 OUT.hdf5          a file laid out as robomimic does: crates/policy/tests/data/robomimic.hdf5
    scripts/policy_reference.py sequences DEMOS.hdf5   reads a file of ours with robomimic's own SequenceDataset
    scripts/policy_reference.py links FOLDER           files with links, strings and attributes of many kinds, all saying the same
    scripts/policy_reference.py strings DEMOS.hdf5     a file of ours: attributes are str, datatypes are the HDF5 library's own
    scripts/policy_reference.py weights MODEL.pth OUT.safetensors     a robomimic checkpoint's weights for policy.safetensors
    scripts/policy_reference.py curve OUT.safetensors small|lift   200 steps of robomimic's actor and PyTorch's Adam: weights,
                                                       batches, first gradient, losses (crates/policy/tests/data/curve.safetensors)
    scripts/policy_reference.py speed BINARY [HIDDEN] [THREADS]   training steps of crates/policy/examples/step_speed.rs
                                                       in turns with PyTorch's
"""

import json
import statistics
import subprocess
import sys
import time


def write_hdf5(path):
    """Two demonstrations with a gap in their numbers, numbers of many types, compressed observations, pictures."""
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
            # The second one as other writers of this layout have it: f32 actions, rewards and dones in a byte.
            other = name == "demo_2"
            demo.create_dataset("actions", data=actions.astype(np.float32) if other else actions)
            demo.create_dataset("states", data=np.array([[0.5, 0.1], [1.5, 0.1], [2.5, 0.1]], dtype=np.float32))
            demo.create_dataset("rewards", data=np.array([0, 0, 1], dtype=np.uint8 if other else np.float64))
            demo.create_dataset("dones", data=np.array([0, 0, 1], dtype=bool if other else np.int64))
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


def write_links(folder):
    """Five layouts that h5py cannot tell apart when it reads, each with the library's oldest, usual and newest format."""
    import h5py
    import numpy as np
    from h5py import h5a, h5s, h5t

    def whole(f):
        data = f.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_name": "Lift", "type": 1, "env_kwargs": {}})
        # So many demonstrations that the newest format keeps their names in a tree.
        for i in range(30):
            demo = data.create_group(f"demo_{i}")
            demo.attrs["num_samples"], demo.attrs["model_file"] = 4, "<mujoco model='é'/>"
            demo["actions"], demo["rewards"] = np.full((4, 7), i / 100), np.zeros(4)
            demo["obs/object"] = np.arange(8.0).reshape(4, 2) + i
        f["mask/train"] = np.array(["demo_0", "demo_12"], dtype="S")
        f["mask/valid"] = np.array(["demo_1"], dtype="S")

    def soft(f):
        for k, demo in f["data"].items():
            demo.move("obs", "observations")
            demo["obs"] = h5py.SoftLink(f"/data/{k}/observations" if k < "demo_2" else "./observations")
        f.move("mask", "filters")
        f["mask"], f["one"] = h5py.SoftLink("filters"), h5py.SoftLink("/data/demo_3/rewards")
        del f["data/demo_4/rewards"]
        f["data/demo_4/rewards"] = h5py.SoftLink("/one")

    def hard(f):
        f["shown"] = f["data"]
        f.move("data/demo_5", "elsewhere")
        f["data/demo_5"] = f["elsewhere"]
        del f["data/demo_6/rewards"]
        f["data/demo_6/rewards"] = h5py.SoftLink("/shown/demo_7/rewards")

    def variable(f):
        for mask in ["train", "valid"]:
            names = f["mask"][mask].asstr()[:]
            del f["mask"][mask]
            f["mask"].create_dataset(mask, data=names, dtype=h5py.string_dtype("utf-8" if mask == "train" else "ascii"))
        # More than eight: the newest format keeps them outside the header.
        for demo in f["data"].values():
            demo.attrs.update({f"more_{i}": i for i in range(12)})

    def fixed(f):
        for group, name, pad, fill in [(f["data"], "env_args", h5t.STR_SPACEPAD, b" "),
                                       (f["data/demo_8"], "model_file", h5t.STR_NULLTERM, b"\0")]:
            text = group.attrs[name].encode().ljust(80, fill)
            del group.attrs[name]
            kind = h5t.C_S1.copy()
            kind.set_size(80), kind.set_strpad(pad), kind.set_cset(h5t.CSET_UTF8)
            h5a.create(group.id, name.encode(), kind, h5s.create(h5s.SCALAR)).write(np.array(text, dtype="S80"), mtype=kind)

    layouts = {"plain": None, "soft": soft, "hard": hard, "variable": variable, "fixed": fixed}
    for name, change in layouts.items():
        for libver in ["earliest", "latest", None]:
            with h5py.File(f"{folder}/{name}_{libver or 'default'}.hdf5", "w", libver=libver) as f:
                whole(f)
                if change:
                    change(f)


def check_strings(path):
    """What robomimic decodes is str or bytes as it expects; the datatypes are those that h5py itself writes."""
    import io

    import h5py
    import numpy as np

    with h5py.File(path) as f, h5py.File(io.BytesIO(), "w") as own:
        own.attrs["text"], own["names"] = "é", np.array(["demo_12"], dtype="S")
        text = own.attrs.get_id("text").get_type()
        assert json.loads(f["data"].attrs["env_args"])["env_name"] == "Lift"
        for group, name in [(f["data"], "env_args")] + [(demo, "model_file") for demo in f["data"].values()]:
            assert isinstance(group.attrs[name], str), name
            # Equal only with an equal base type.
            assert group.attrs.get_id(name).get_type().equal(text), f"{group.name}@{name}"
        assert f["mask/train"].id.get_type().equal(own["names"].id.get_type())
        assert [n.decode("utf-8") for n in np.array(f["mask/train"][:])] == ["demo_0", "demo_12"]
        assert f["data"].attrs["total"] == sum(d.attrs["num_samples"] for d in f["data"].values())


def actor(inputs, hidden, min_std=1e-4):
    """robomimic's RNN-GMM actor itself, in training mode, and its loss."""
    from collections import OrderedDict

    import robomimic.models.policy_nets as policy_nets
    import robomimic.utils.obs_utils as obs_utils
    from robomimic.config import config_factory

    obs_utils.initialize_obs_utils_with_obs_specs({"obs": {"low_dim": ["object"]}})
    encoder = obs_utils.obs_encoder_kwargs_from_config(config_factory("bc").observation.encoder)
    net = policy_nets.RNNGMMActorNetwork(OrderedDict(object=[inputs]), 7, [], hidden, 2, rnn_kwargs={"bidirectional": False},
                                         num_modes=5, min_std=min_std, encoder_kwargs=encoder)
    net.train()
    return net, lambda x, a: -net.forward_train({"object": x}).log_prob(a).mean()


def weights(checkpoint, path):
    """Every weight once, under its own name; those that PyTorch shares under two names are copied."""
    import torch
    from safetensors.torch import save_file

    model = torch.load(checkpoint, map_location="cpu", weights_only=False)["model"]
    save_file({k: v.clone().contiguous() for k, v in model.items()}, path)


def curve(path, size="small"):
    """Trains on batches that the file holds, in their order: batch k is sequences k * batch .. + batch, counted round."""
    import torch
    from safetensors.torch import save_file

    torch.manual_seed(0)
    sizes = {"small": (6, 12, 5, 64, 16, 1e-3, 1e-2), "lift": (19, 400, 10, 1000, 100, 1e-4, 1e-4)}
    inputs, hidden, steps, pool, batch, rate, min_std = sizes[size]
    net, loss_of = actor(inputs, hidden, min_std)
    x = 2 * torch.rand(pool, steps, inputs) - 1
    a = torch.tanh(x @ torch.randn(inputs, 7) + 0.05 * torch.randn(pool, steps, 7))
    # The MLP and the decoder stand in robomimic's state under a second name as well.
    own = {k: v for k, v in net.state_dict().items() if "per_step_net" not in k}
    out = {f"initial.policy.{k}": v.clone() for k, v in own.items()}
    adam = torch.optim.Adam(net.parameters(), lr=rate)
    losses = []
    for k in range(200):
        rows = torch.arange(k * batch, (k + 1) * batch) % pool
        loss = loss_of(x[rows], a[rows])
        adam.zero_grad()
        loss.backward()
        if k == 0:
            out.update({f"gradient.policy.{n}": p.grad.clone() for n, p in net.named_parameters() if "per_step_net" not in n})
        adam.step()
        losses.append(loss.item())
    out.update({f"final.policy.{k}": v.clone() for k, v in net.state_dict().items() if "per_step_net" not in k})
    net.eval()
    with torch.no_grad():
        d = net.forward_train({"object": x[:1]})
    out["means"], out["weights"] = d.component_distribution.base_dist.loc[0], d.mixture_distribution.probs[0]
    out["observations"], out["actions"], out["losses"] = x, a, torch.tensor(losses, dtype=torch.float64)
    note = {"hidden": hidden, "batch": batch, "rate": rate, "min_std": min_std, "torch": torch.__version__}
    save_file({k: v.contiguous() for k, v in out.items()}, path, {k: str(v) for k, v in note.items()})
    print(f"loss {losses[0]:.4f} -> {losses[-1]:.4f}")


def speed(binary, hidden="400", threads="1"):
    """Turns of five steps each: noise of the machine hits both. Prints medians and the ratio."""
    import torch

    torch.set_num_threads(int(threads))
    net, loss_of = actor(19, int(hidden))
    adam = torch.optim.Adam(net.parameters(), lr=1e-4)
    x, a = 2 * torch.rand(100, 10, 19) - 1, 2 * torch.rand(100, 10, 7) - 1

    def theirs(count):
        start = time.perf_counter()
        for _ in range(count):
            loss = loss_of(x, a)
            adam.zero_grad()
            loss.backward()
            adam.step()
        return 1e3 * (time.perf_counter() - start) / count

    ours = subprocess.Popen([binary, hidden, threads], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def turn(count):
        ours.stdin.write(f"{count}\n")
        ours.stdin.flush()
        return float(ours.stdout.readline())

    theirs(5), turn(5)
    pairs = [(turn(5), theirs(5)) for _ in range(15)]
    mine, torchs = (statistics.median(p[k] for p in pairs) for k in range(2))
    ratio = statistics.median(p[0] / p[1] for p in pairs)
    best = min(p[0] for p in pairs), min(p[1] for p in pairs)
    print(f"hidden {hidden}, {threads} threads: hingecast {mine:.1f} ms, PyTorch {torch.__version__} {torchs:.1f} ms (medians);"
          f" ratio {ratio:.2f} (median of turns); best turns {best[0]:.1f} and {best[1]:.1f} ms")


if __name__ == "__main__":
    verbs = {"speed": speed, "curve": curve, "weights": weights, "hdf5": write_hdf5, "sequences": read_sequences, "links": write_links,
             "strings": check_strings}
    if len(sys.argv) < 3 or sys.argv[1] not in verbs:
        sys.exit(__doc__)
    verbs[sys.argv[1]](*sys.argv[2:])

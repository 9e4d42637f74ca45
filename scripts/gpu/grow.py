"""A wider network that answers as the given one does (Net2Net, Chen et al. 2016).

Every level's channels are repeated, from the first on, until there are enough. A layer that reads a channel and its copies shares the old
kernel among them, so answers stay the same; noise on the shares lets the copies learn different things.
"""

import torch

# Standard deviation of the noise ÷ the root mean square of the kernel's entries.
NOISE = 0.02


def grown(tensors, width, noise=NOISE, seed=1):
    """The tensors with `width` channels at the finest level; `noise` 0 keeps every answer."""
    narrow = tensors["last.weight"].shape[1]
    if not narrow <= width <= 2 * narrow:
        raise SystemExit(f"a network of width {narrow} grows to {narrow} ... {2 * narrow}, not to {width}")
    if width == narrow:
        return tensors
    random = torch.Generator().manual_seed(seed)
    origins = lambda channels: torch.arange(channels * width // narrow) % channels
    result = {}
    for name, values in tensors.items():
        rows = origins(len(values)) if grows_outputs(name) else torch.arange(len(values))
        values = values[rows]
        if values.dim() > 1 and not name.startswith("down.0.conv0."):
            # A block after a skip reads two groups of channels, one behind the other.
            groups = 2 if name.endswith(".block.conv0.weight") else 1
            each = values.shape[1] // groups
            columns = torch.cat([origins(each) + group * each for group in range(groups)])
            copies = torch.bincount(columns, minlength=values.shape[1])[columns]
            values = values[:, columns] / copies[:, None, None]
            size = values.square().mean().sqrt() * (copies > 1).float()[:, None, None] * noise
            values = values + torch.randn(values.shape, generator=random) * size
        result[name] = values.contiguous()
    return result


def grows_outputs(name):
    """Whether a tensor's first dimension counts channels of a level: all but the answer's axes and a gate's one score."""
    return not name.startswith("last.") and ".gate.score." not in name

"""``python -m tools.clip_authoring [NAME ...]``: regenerate the embedded clips, all or those named, in place."""

import sys
from pathlib import Path

import models.mocap
from models.mocap.readers.own_bvh import write_bvh
from tools.clip_authoring import choreography, flights, gait

CLIPS = choreography.CLIPS | gait.CLIPS | flights.CLIPS


def main(names: list[str]) -> int:
    """Write the named clips, or all if none is named; return the exit status."""
    unknown = sorted(set(names) - set(CLIPS))
    if unknown:
        print(f"no clip {', '.join(unknown)}; there are {', '.join(CLIPS)}", file=sys.stderr)
        return 2
    for name in names or CLIPS:
        path = Path(models.mocap.__file__).parent / "clips" / f"{name}.bvh"
        clip = CLIPS[name]()
        write_bvh(clip, path)
        print(f"{path.name}: {clip.n_frames} frames, {clip.duration:.2f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

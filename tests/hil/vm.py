"""`make hil-vm`: the HID driver on Linux's own hidraw, in a virtual machine whose kernel has uhid.

Skips with a message where something is missing: it needs qemu-system-x86_64, busybox-static, a C compiler, and
either a kernel with modules in /boot and /lib/modules, or apt-get to fetch Debian's (some 70 MB, kept in runs/hil-vm).
The guest sees this machine's files and changes none. An emulated processor would compile for a quarter of an hour, so
the driver's units are compiled here beforehand, for any processor of the kind (`tests.hil.rehearsal`).
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.devices.firmware import COMPILER, ROOT, compile_c

FOLDER = ROOT / "runs" / "hil-vm"
MODULES = ("virtio_pci", "9pnet_virtio", "9p", "hid-generic", "uhid")
SECONDS = 400
ANY_PROCESSOR = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "HVF_CACHE_DIR": str(FOLDER)}

INIT = """#!/bin/busybox sh
/bin/busybox --install -s /bin
mount -t proc proc /proc; mount -t sysfs sys /sys; mount -t devtmpfs dev /dev
for module in {modules}; do modprobe $module; done
mount -t 9p -o trans=virtio,version=9p2000.L,msize=524288,cache=loose,ro host /host || poweroff -f
for place in proc sys dev; do mount --move /$place /host/$place; done
mount -t tmpfs tmp /host/tmp
cd /host
export PYTHONDONTWRITEBYTECODE=1 {settings}
chroot /host /bin/sh -c 'cd {root} && {python} -m tests.hil.guest {library}'
poweroff -f
"""


class MissingError(Exception):
    """Something is missing on this machine; says how to get it."""


def kernel() -> tuple[Path, Path]:
    """A kernel and the folder with its modules.

    Raises
    ------
    MissingError
        If there is none here, and none can be fetched.
    """
    for image in sorted(Path("/boot").glob("vmlinuz-*"), reverse=True):
        modules = Path("/lib/modules") / image.name.removeprefix("vmlinuz-")
        if list(modules.rglob("uhid.ko*")):
            return image, modules
    fetched = FOLDER / "kernel"
    if not list(fetched.glob("boot/vmlinuz-*")):
        try:
            _fetch(fetched)
        except (OSError, StopIteration, subprocess.CalledProcessError) as error:
            raise MissingError(
                f"no kernel with uhid in /boot, and none could be fetched with apt-get ({error}); expected Debian's "
                "package linux-image-amd64, or its sources in apt"
            ) from None
    (image,) = fetched.glob("boot/vmlinuz-*")
    return image, fetched / "lib" / "modules" / image.name.removeprefix("vmlinuz-")


def _fetch(into: Path) -> None:
    depends = subprocess.run(
        ["apt-cache", "depends", "linux-image-amd64"], capture_output=True, text=True, check=True
    ).stdout
    package = next(line.split()[-1] for line in depends.splitlines() if "Depends: linux-image" in line)
    subprocess.run(["apt-get", "download", "--quiet", package], cwd=FOLDER, check=True)
    (archive,) = FOLDER.glob(f"{package}_*.deb")
    subprocess.run(["dpkg", "-x", archive, into], check=True)
    archive.unlink()


def initramfs(busybox: str, modules: Path, library: Path) -> Path:
    """Initial file system: busybox, the modules, and the script that continues on this machine's files."""
    tree = FOLDER / "initramfs"
    shutil.rmtree(tree, ignore_errors=True)
    for name in ("bin", "proc", "sys", "dev", "host", f"lib/modules/{modules.name}"):
        (tree / name).mkdir(parents=True)
    shutil.copy(busybox, tree / "bin" / "busybox")
    inside = tree / "lib" / "modules" / modules.name
    for part in ("net/9p", "fs/9p", "fs/netfs", "fs/fscache", "drivers/virtio", "drivers/hid"):
        for module in (modules / "kernel" / part).glob("*.ko*"):
            shutil.copy(module, inside)
    subprocess.run([busybox, "depmod", "-b", tree, modules.name], check=True)
    settings = " ".join(f"{name}='{value}'" for name, value in ANY_PROCESSOR.items())
    script = INIT.format(
        modules=" ".join(MODULES), settings=settings, root=ROOT, python=sys.executable, library=library
    )
    (tree / "init").write_text(script)
    (tree / "init").chmod(0o755)
    names = "\n".join(str(path.relative_to(tree)) for path in sorted(tree.rglob("*")))
    packed = FOLDER / "initramfs.cpio"
    with packed.open("wb") as out:
        subprocess.run([busybox, "cpio", "-o", "-H", "newc"], cwd=tree, input=names.encode(), stdout=out, check=True)
    return packed


def main() -> int:
    """Exit code 0 if the guest passed or something is missing here, 1 if it failed."""
    qemu, busybox = shutil.which("qemu-system-x86_64"), shutil.which("busybox")
    FOLDER.mkdir(parents=True, exist_ok=True)
    try:
        if qemu is None or busybox is None or COMPILER is None:
            raise MissingError(
                "expected qemu-system-x86_64, busybox and cc (apt install qemu-system-x86 busybox-static gcc)"
            )
        image, modules = kernel()
    except MissingError as missing:
        print(f"hil-vm: skipped: {missing}", file=sys.stderr)
        return 0
    firmware = ROOT / "firmware" / "hvf_hid.c"
    library, mock = (
        compile_c(FOLDER, firmware),
        compile_c(FOLDER, ROOT / "tests" / "devices" / "mock_hidapi.c", firmware),
    )
    subprocess.run(
        [sys.executable, "-m", "tests.hil.rehearsal", mock], cwd=ROOT, env=os.environ | ANY_PROCESSOR, check=True
    )
    command = [
        qemu, "-accel", "tcg", "-cpu", "max", "-m", "2048", "-smp", "1", "-nographic", "-no-reboot", "-nic", "none",
        "-kernel", str(image), "-initrd", str(initramfs(busybox, modules, library)),
        "-append", "console=ttyS0 quiet panic=-1",
        "-virtfs", "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap",
    ]  # fmt: skip
    log = FOLDER / "guest.txt"
    with log.open("wb") as out:
        try:
            subprocess.run(
                command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, timeout=SECONDS, check=False
            )
        except subprocess.TimeoutExpired:
            print(f"hil-vm: the guest had not ended after {SECONDS} s; its output until then:", file=sys.stderr)
    text = log.read_text(errors="replace")
    print(text[-6000:])
    return 0 if "hil-vm: passed" in text else 1


if __name__ == "__main__":
    sys.exit(main())

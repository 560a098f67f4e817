#!/usr/bin/env bash
# Runs the AVX-512 kernels where the processor has none: in Bochs, a Linux that holds one test and nothing else. They must
# give the bytes of the plain kernels. It takes a minute and a half.
set -euo pipefail
cd "$(dirname "$0")/.."

isolinux=/usr/lib/ISOLINUX/isolinux.bin
for tool in bochs xorriso cpio busybox $isolinux; do
  command -v $tool > /dev/null || [ -f $tool ] && continue
  echo "AVX-512 tests are skipped: no $tool (Debian: apt-get install bochs bochs-term xorriso cpio busybox-static isolinux)"
  exit 77  # what lacks a tool was not run: not the same as passed
done

PATH=$PATH:$PWD/.venv/bin
cmake -S . -B build/release -G Ninja -DENDOSDK_BUILD_TESTS=ON > /dev/null
cmake --build build/release --target test_kernel_bytes
program=$PWD/build/release/cpp/tests/test_kernel_bytes

work=$PWD/build/avx512
rm -rf "$work"
mkdir -p "$work"/{kernel,disk/isolinux,root/{bin,proc,lib,lib64}}
cd "$work"
linux=$(apt-cache depends linux-image-cloud-amd64 | sed -n 's/ *Depends: //p')
(cd kernel && apt-get download "$linux" > /dev/null && dpkg -x ./*.deb .)
cp kernel/boot/vmlinuz-* disk/vmlinuz
cp $isolinux /usr/lib/syslinux/modules/bios/ldlinux.c32 disk/isolinux/

cp "$program" root/test
cp "$(command -v busybox)" root/bin/busybox
ln -s busybox root/bin/sh
ldd "$program" | grep -o '/[^ ]*' | while read -r library; do cp --parents -L "$library" root; done
cat > root/init << 'END'
#!/bin/sh
busybox mount -t proc proc /proc
echo BEGIN
/test avx512 depth 1 && /test
echo "END $?"
busybox sleep 2  # until the serial line has sent it
busybox poweroff -f
END
chmod +x root/init
(cd root && find . | cpio --quiet -o -H newc > ../disk/initrd)

# Bochs 2.7 has gaps in the local APIC, in protection keys, and in the size of a compact XSAVE area. Linux 6.1 stops at the
# first, and goes without AVX at the others.
cat > disk/isolinux/isolinux.cfg << 'END'
DEFAULT linux
LABEL linux
  KERNEL /vmlinuz
  INITRD /initrd
  APPEND console=ttyS0 panic=-1 mitigations=off nokaslr nosmp noapic nolapic clearcpuid=pku,ospke,xsavec,xsaves,aperfmperf
END
xorriso -as mkisofs -quiet -o boot.iso -b isolinux/isolinux.bin -c isolinux/boot.cat \
  -no-emul-boot -boot-load-size 4 -boot-info-table disk
cat > bochsrc << 'END'
cpu: model=corei7_skylake_x, ips=50000000
memory: guest=512, host=512
romimage: file=/usr/share/bochs/BIOS-bochs-latest
vgaromimage: file=/usr/share/bochs/VGABIOS-lgpl-latest
ata0-master: type=cdrom, path=boot.iso, status=inserted
boot: cdrom
com1: enabled=1, mode=file, dev=serial.txt
display_library: term
log: bochs.log
END
echo c > commands  # Debian's Bochs waits for a command: continue
TERM=xterm timeout 1200 script -qc "bochs -q -f bochsrc -rc commands" /dev/null > screen.txt 2>&1 < /dev/null &
wait || true  # Bochs calls it a failure when Linux has switched the machine off

diff <("$program") <(tr -d '\r' < serial.txt | sed -n '/^BEGIN/,/^END/p' | sed '1d;$d')
grep -q '^END 0' serial.txt
echo "every kernel gives the same bytes with AVX-512"

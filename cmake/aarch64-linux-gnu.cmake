# Builds for 64-bit ARM with Debian's cross compiler (g++-aarch64-linux-gnu); tests run in qemu-aarch64 (qemu-user).
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
# What an emulated program finds below / before it looks on this machine. ONNX Runtime asks Linux for the maker of the processor,
# and crashes where that is not ARM's. The emulator has the features of all.
set(system ${CMAKE_BINARY_DIR}/system)
file(MAKE_DIRECTORY ${system}/proc)
file(CREATE_LINK /usr/aarch64-linux-gnu/lib ${system}/lib SYMBOLIC)
file(WRITE ${system}/proc/cpuinfo "processor\t: 0\nCPU implementer\t: 0x41\nCPU architecture: 8\nCPU variant\t: 0x3\nCPU part\t: 0xd0c\n\n")
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64 -L ${system})

# Flags for all of our own code, as one interface target.
add_library(endosdk_flags INTERFACE)
target_compile_options(
  endosdk_flags
  INTERFACE -Wall
            -Wextra
            -Wpedantic
            -Wshadow
            -Wconversion
            -Wno-sign-conversion # clang counts it to the above, GCC does not
            -Wdouble-promotion
            -Wold-style-cast
            -Werror
            # Fusing a product with a sum would round differently from one instruction set to the next.
            -ffp-contract=off
            # Binaries must not tell where they were built, and must come out the same in any folder.
            -ffile-prefix-map=${CMAKE_SOURCE_DIR}=endosdk
            -ffile-prefix-map=${CMAKE_BINARY_DIR}=build
            -fstack-protector-strong
            $<$<PLATFORM_ID:Linux>:-fstack-clash-protection>
            $<$<CONFIG:Release>:-D_FORTIFY_SOURCE=2>)
if(CMAKE_SYSTEM_NAME STREQUAL Linux)
  target_link_options(endosdk_flags INTERFACE LINKER:-z,relro,-z,now,-z,noexecstack)
elseif(MINGW)
  # A program finds all it needs of the compiler inside itself.
  target_link_options(endosdk_flags INTERFACE -static -fstack-protector-strong LINKER:--dynamicbase,--nxcompat,--high-entropy-va)
  # GCC does not align the stack to more than 16 bytes, whatever registers its code spills there.
  target_compile_options(endosdk_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wa,-muse-unaligned-vector-move>)
endif()

if(ENDOSDK_SANITIZE)
  target_compile_options(endosdk_flags INTERFACE -fsanitize=${ENDOSDK_SANITIZE} -fno-sanitize-recover=all
                                                 -fno-omit-frame-pointer)
  target_link_options(endosdk_flags INTERFACE -fsanitize=${ENDOSDK_SANITIZE})
endif()

# libendosdk: the C interface over the same core that the Python module uses, and the session on top.
enable_language(C)
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
include(${PROJECT_SOURCE_DIR}/cmake/onnxruntime_headers.cmake)

# Before each build, see there.
get_property(instruction_sets TARGET endosdk_core PROPERTY ENDOSDK_INSTRUCTION_SETS)
list(JOIN instruction_sets " " instruction_sets)
set(build_info ${CMAKE_CURRENT_BINARY_DIR}/build_info.cpp)
add_custom_target(
  endosdk_build_info
  COMMAND
    ${CMAKE_COMMAND} -D "SOURCE=${PROJECT_SOURCE_DIR}" -D "TEMPLATE=${CMAKE_CURRENT_SOURCE_DIR}/src/library/build_info.cpp.in"
    -D "OUTPUT=${build_info}" -D "ENDOSDK_VERSION=${ENDOSDK_VERSION}" -D
    "ENDOSDK_COMPILER=${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}" -D "ENDOSDK_BUILD_TYPE=$<CONFIG>" -D
    "ENDOSDK_SANITIZE=${ENDOSDK_SANITIZE}" -D "ENDOSDK_TARGET=${CMAKE_SYSTEM_NAME} ${CMAKE_SYSTEM_PROCESSOR}" -D
    "ENDOSDK_INSTRUCTION_SETS=${instruction_sets}" -P "${PROJECT_SOURCE_DIR}/cmake/build_info.cmake"
  BYPRODUCTS ${build_info}
  COMMENT "Looking up the commit"
  VERBATIM)

add_library(
  endosdk_objects OBJECT
  src/library/capi.cpp
  src/library/capi_measure.cpp
  src/library/capi_stream.cpp
  src/library/capi_structs.cpp
  src/library/guarded.cpp
  src/library/log_reader.cpp
  src/library/open_request.cpp
  src/library/ort_session.cpp
  src/library/results_in_flight.cpp
  src/library/runtime.cpp
  src/library/runtime_table.cpp
  src/library/session_interface.cpp
  src/library/session_threads.cpp
  src/library/signature.cpp
  ${build_info})
add_dependencies(endosdk_objects endosdk_build_info)
target_include_directories(endosdk_objects PUBLIC include src)
target_include_directories(endosdk_objects SYSTEM PUBLIC ${ONNXRUNTIME_INCLUDE_DIR})
target_link_libraries(endosdk_objects PUBLIC endosdk_core ${CMAKE_DL_LIBS} PRIVATE endosdk_flags)
endosdk_precompile(endosdk_objects)
# As in flags.cmake, for the one folder that need not be the project's.
target_compile_options(endosdk_objects PRIVATE -ffile-prefix-map=${ONNXRUNTIME_INCLUDE_DIR}=onnxruntime)

if(ENDOSDK_BUILD_TESTS)
  # The ABI check reads the types of the interface from here.
  set_source_files_properties(src/library/capi.cpp src/library/capi_measure.cpp src/library/capi_stream.cpp
                              PROPERTIES COMPILE_OPTIONS -g SKIP_PRECOMPILE_HEADERS ON)
endif()

if(BUILD_SHARED_LIBS)
  target_compile_definitions(endosdk_objects PUBLIC $<$<PLATFORM_ID:Windows>:ENDOSDK_BUILDING>)
  add_library(endosdk SHARED $<TARGET_OBJECTS:endosdk_objects>)
  target_link_libraries(endosdk PRIVATE endosdk_core ${CMAKE_DL_LIBS} endosdk_flags)
  if(CMAKE_SYSTEM_NAME STREQUAL Linux)
    set(export_map ${CMAKE_CURRENT_SOURCE_DIR}/endosdk.map)
    target_link_options(endosdk PRIVATE LINKER:--version-script,${export_map})
    set_target_properties(endosdk PROPERTIES LINK_DEPENDS ${export_map})
    # Its worker threads sleep between frames and never end; dlclose must not take the code away from under them.
    target_link_options(endosdk PRIVATE LINKER:-z,nodelete)
  endif()
  set(ENDOSDK_PC_STATIC "")
else()
  # One archive with everything, so that a vendor links one file.
  get_target_property(core_objects endosdk_core ENDOSDK_KERNEL_OBJECTS)
  add_library(endosdk STATIC $<TARGET_OBJECTS:endosdk_objects> $<TARGET_OBJECTS:endosdk_core> ${core_objects})
  target_compile_definitions(endosdk_objects PUBLIC $<$<PLATFORM_ID:Windows>:ENDOSDK_STATIC>)
  target_compile_definitions(endosdk INTERFACE $<$<PLATFORM_ID:Windows>:ENDOSDK_STATIC>)
  # A program in C is linked by the C compiler, which does not add what C++ needs.
  target_link_libraries(endosdk PUBLIC Threads::Threads ${CMAKE_DL_LIBS} INTERFACE stdc++ m)
  set(ENDOSDK_PC_STATIC " -lstdc++ -lm -lpthread -ldl")
endif()
if(ENDOSDK_SANITIZE)
  # A sanitizer's own functions are part of the program, whatever language that is written in.
  target_link_options(endosdk INTERFACE -fsanitize=${ENDOSDK_SANITIZE})
elseif(BUILD_SHARED_LIBS AND CMAKE_SYSTEM_NAME STREQUAL Linux)
  target_link_options(endosdk PRIVATE LINKER:-z,defs)
endif()
add_library(endosdk::endosdk ALIAS endosdk)
target_include_directories(endosdk INTERFACE $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>
                                             $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
# The number behind the name changes only when a program built against an older release would no longer run. Release
# 0.1 is age 0; fields and functions that are added do not count.
set_target_properties(endosdk PROPERTIES VERSION ${PROJECT_VERSION} SOVERSION 0)

install(TARGETS endosdk EXPORT endosdkTargets COMPONENT sdk)
install(DIRECTORY include/endosdk TYPE INCLUDE COMPONENT sdk)
# What a device's file says of its software goes with it, and so do the models that were tested, and the pages that the header
# and these papers refer to. They keep their folders, for the links between them.
set(papers LICENSE THIRD_PARTY_NOTICES.md SECURITY.md CHANGELOG.md)
foreach(page calibrating c-library hardening limits measuring model-file models range real-time troubleshooting trust)
  list(APPEND papers docs/${page}.md)
endforeach()
foreach(paper embed.md endosdk.cdx.json endosdk.spdx.json providers.md real-time.md requirements.md soup.md systems.md)
  list(APPEND papers docs/device/${paper})
endforeach()
foreach(paper ${papers})
  get_filename_component(folder ${paper} DIRECTORY)
  install(FILES ${PROJECT_SOURCE_DIR}/${paper} DESTINATION ${CMAKE_INSTALL_DOCDIR}/${folder} COMPONENT sdk)
endforeach()
install(DIRECTORY examples TYPE DOC COMPONENT sdk)
install(
  DIRECTORY ${PROJECT_SOURCE_DIR}/models
  DESTINATION ${CMAKE_INSTALL_DATADIR}/endosdk
  COMPONENT sdk
  FILES_MATCHING
  PATTERN "*.onnx"
  PATTERN "*.md"
  PATTERN "models.toml"
  PATTERN "tiny-for-tests.onnx" EXCLUDE)
set(config_folder ${CMAKE_INSTALL_LIBDIR}/cmake/endosdk)
install(EXPORT endosdkTargets NAMESPACE endosdk:: DESTINATION ${config_folder} COMPONENT sdk)
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/endosdkConfig.cmake.in endosdkConfig.cmake
                              INSTALL_DESTINATION ${config_folder})
# While the first number is 0, a release promises only to work with programs built against the same second number.
write_basic_package_version_file(endosdkConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/endosdkConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/endosdkConfigVersion.cmake
        DESTINATION ${config_folder} COMPONENT sdk)
set(pc_folder ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
file(RELATIVE_PATH ENDOSDK_PC_TO_PREFIX /${pc_folder} /)
configure_file(${PROJECT_SOURCE_DIR}/cmake/endosdk.pc.in endosdk.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/endosdk.pc DESTINATION ${pc_folder} COMPONENT sdk)

# What tests and fuzzers open: the runtime of this checkout's Python environment, unless another is named.
file(GLOB found ${PROJECT_SOURCE_DIR}/.venv/lib/python3*/site-packages/onnxruntime/capi/libonnxruntime.so.*)
set(ENDOSDK_TEST_RUNTIME "${found}" CACHE FILEPATH "The libonnxruntime that tests open")

# Writes what is known of a build only when it is made: the commit of its sources. Run by every build, because a commit
# does not configure anew; a file that would say the same is left alone, so nothing is compiled for it.
#     cmake -D SOURCE=<folder> -D TEMPLATE=<file> -D OUTPUT=<file> -D <what else the template asks for> -P build_info.cmake
set(ENDOSDK_COMMIT unknown)
# Set by git itself for what it runs, such as hooks; they would name another repository.
unset(ENV{GIT_DIR})
unset(ENV{GIT_WORK_TREE})

# The answer of git about the sources, or nothing.
function(ask_git answer)
  set(found "")
  set(failed TRUE)
  find_program(git git)
  if(git)
    execute_process(
      COMMAND ${git} -C "${SOURCE}" ${ARGN}
      RESULT_VARIABLE failed
      OUTPUT_VARIABLE found
      OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  endif()
  if(failed)
    set(found "")
  endif()
  set(${answer} "${found}" PARENT_SCOPE)
endfunction()

# Unpacked inside another project's repository, the sources must not take that project's commit for their own.
ask_git(top rev-parse --show-toplevel)
file(REAL_PATH "${SOURCE}" here)
if(top STREQUAL here)
  ask_git(head rev-parse --short=12 HEAD)
  ask_git(changes status --porcelain --untracked-files=no)
  if(head AND changes)
    set(ENDOSDK_COMMIT "${head}+changes")
  elseif(head)
    set(ENDOSDK_COMMIT "${head}")
  endif()
endif()
configure_file("${TEMPLATE}" "${OUTPUT}" @ONLY)

# For tests in CMake: run(command...) fails where the command does, and puts what it prints into `out`.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE out ERROR_VARIABLE out)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "exit code ${code} of: ${command}\n${out}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()

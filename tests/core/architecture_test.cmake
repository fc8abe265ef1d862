# cmake -DCORE=FOLDER -P architecture_test.cmake: core/ must know no DDS, no YAML, no command line,
# no logger, no wall clock and no terminal. Fails with every line that does.
if(NOT IS_DIRECTORY "${CORE}")
  message(FATAL_ERROR "CORE = '${CORE}' is no folder")
endif()

set(outside "fastdds|fastrtps|fastcdr|yaml-cpp|CLI|CLI11|spdlog|iostream|idl|server|clients|config")
set(forbidden
  "^ *# *include *[<\"](${outside})[/.>\"]"
  "(system|steady|high_resolution)_clock" "gettimeofday" "clock_gettime" "std::time[ (]"
  "std::c(out|err|log)[^a-z_]" "[^a-z_n]printf[ (]" "getenv")

file(GLOB_RECURSE sources ${CORE}/*.hpp ${CORE}/*.cpp)
list(LENGTH sources source_count)
if(source_count LESS 50)
  message(FATAL_ERROR "only ${source_count} sources under ${CORE}: is this core/?")
endif()

set(faults "")
foreach(source IN LISTS sources)
  foreach(pattern IN LISTS forbidden)
    file(STRINGS ${source} lines REGEX "${pattern}")
    foreach(line IN LISTS lines)
      # A comment may speak of them.
      if(NOT line MATCHES "^ *//")
        string(APPEND faults "  ${source}: ${line}\n")
      endif()
    endforeach()
  endforeach()
endforeach()

if(faults)
  message(FATAL_ERROR "core/ may not use these:\n${faults}")
endif()
message(STATUS "${source_count} sources of core/ keep to themselves")

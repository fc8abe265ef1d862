# cmake -DBUILD=FOLDER -DPREFIX=FOLDER -P install_test.cmake: installs to PREFIX and lets the programs
# find there what they need. PREFIX is removed before and afterwards.
function(run expected_code wanted)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE out ERROR_VARIABLE out)
  if(NOT code EQUAL expected_code OR NOT out MATCHES "${wanted}")
    message(FATAL_ERROR "${ARGN}\ngave ${code} instead of ${expected_code}, or not '${wanted}':\n${out}")
  endif()
endfunction()

file(REMOVE_RECURSE ${PREFIX})
run(0 "" ${CMAKE_COMMAND} --install ${BUILD} --prefix ${PREFIX})
foreach(file bin/stillmap bin/stillmap-server
        lib/systemd/system/stillmap-server.service etc/stillmap/server.yaml
        share/stillmap/models/street/model.onnx share/stillmap/models/kitti/model.onnx share/stillmap/server/default.yaml
        share/stillmap/idl/stillmap_msgs.idl share/doc/stillmap/README.md share/doc/stillmap/clients/gateway/lichtblick_layout.json
        share/doc/stillmap/examples/follow_and_query.cpp share/doc/stillmap-server/examples/secured.conf)
  if(NOT EXISTS ${PREFIX}/${file})
    message(FATAL_ERROR "${file} was not installed")
  endif()
endforeach()

# Pages lead to pages that were installed, too.
file(GLOB_RECURSE pages ${PREFIX}/share/doc/stillmap/README.md)
set(link_count 0)
foreach(page ${pages})
  file(READ ${page} text)
  string(REGEX MATCHALL "\\([^() :#]*README\\.md" links "${text}")
  get_filename_component(folder ${page} DIRECTORY)
  foreach(link ${links})
    string(SUBSTRING ${link} 1 -1 link)
    math(EXPR link_count "${link_count} + 1")
    if(NOT EXISTS ${folder}/${link})
      message(FATAL_ERROR "${page} leads to ${link}, which was not installed")
    endif()
  endforeach()
endforeach()
if(link_count LESS 50)
  message(FATAL_ERROR "only ${link_count} links between the pages were found")
endif()

# One network has a licence of its own.
file(READ ${PREFIX}/share/doc/stillmap-data/copyright copyright)
if(NOT copyright MATCHES "MIT License.*share/stillmap/models/kitti.*CC BY-NC-SA 4.0")
  message(FATAL_ERROR "the data's copyright does not name both licences:\n${copyright}")
endif()

run(0 "stillmap-server [0-9.]+" ${PREFIX}/bin/stillmap-server --version)
run(0 "can be used" ${PREFIX}/bin/stillmap-server --check-config ${PREFIX}/etc/stillmap/server.yaml)
run(2 "--log-level or STILLMAP_LOG_LEVEL: 'loud' is none of debug.error.info.warning"
  ${CMAKE_COMMAND} -E env STILLMAP_LOG_LEVEL=loud ${PREFIX}/bin/stillmap-server)
run(2 "--delivery: 'some' is none of every.latest" ${PREFIX}/bin/stillmap-server --delivery some)

# Only the installation has this robot.
file(READ ${PREFIX}/share/stillmap/robots/car.yaml robot)
file(WRITE ${PREFIX}/share/stillmap/robots/only_installed.yaml "${robot}")
file(WRITE ${PREFIX}/robot.yaml "labels: {source: none}\ntraversability: {profiles: [only_installed]}\n")
run(0 "can be used" ${PREFIX}/bin/stillmap-server --check-config ${PREFIX}/robot.yaml)
run(2 "only_installed" ${BUILD}/bin/stillmap-server --check-config ${PREFIX}/robot.yaml)

# The unit names the places that were installed to.
file(READ ${PREFIX}/lib/systemd/system/stillmap-server.service unit)
string(FIND "${unit}" "ExecStart=${PREFIX}/bin/stillmap-server --config ${PREFIX}/etc/stillmap/server.yaml" at)
if(at EQUAL -1 OR unit MATCHES "@(prefix|etc)@")
  message(FATAL_ERROR "the unit does not start what was installed:\n${unit}")
endif()

# In a secured domain systemd hands the server all that an identity consists of.
run(0 "" ${PREFIX}/bin/stillmap security init ${PREFIX}/keys)
file(GLOB identity RELATIVE ${PREFIX}/keys/server ${PREFIX}/keys/server/*)
file(READ ${PREFIX}/share/doc/stillmap-server/examples/secured.conf secured)
foreach(file ${identity})
  if(NOT secured MATCHES "LoadCredential=${file}:[^\n]+/${file}\n")
    message(FATAL_ERROR "secured.conf does not load ${file}")
  endif()
endforeach()
file(WRITE ${PREFIX}/secured.yaml "labels: {source: none}\n")
run(0 "can be used" ${CMAKE_COMMAND} -E env STILLMAP_SECURITY=${PREFIX}/keys/server
  ${PREFIX}/bin/stillmap-server --check-config ${PREFIX}/secured.yaml)

# A PCD file is read with what is installed.
file(WRITE ${PREFIX}/scans/0.pcd "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\n"
  "HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n1 2 3\n")
run(2 "usable[ \n]+points are all at one place" ${PREFIX}/bin/stillmap map ${PREFIX}/scans --sensor vlp_16 --out ${PREFIX}/out)
file(REMOVE_RECURSE ${PREFIX})

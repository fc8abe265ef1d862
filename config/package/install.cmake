# `cmake --install`: what a user needs, under the prefix. Programs find it from where they lie
# themselves. Components become Debian packages (deb.cmake).
install(TARGETS stillmap-server RUNTIME DESTINATION bin COMPONENT server)
install(TARGETS stillmap stillmap-gateway RUNTIME DESTINATION bin COMPONENT tools)
# The page, where it was bundled (make web).
install(DIRECTORY ${PROJECT_BINARY_DIR}/share/stillmap/web DESTINATION share/stillmap COMPONENT tools OPTIONAL)

foreach(folder models robots sensors server dds ros)
  if(IS_DIRECTORY ${PROJECT_SOURCE_DIR}/config/${folder})
    install(DIRECTORY ${PROJECT_SOURCE_DIR}/config/${folder} DESTINATION share/stillmap COMPONENT data
      PATTERN README.md EXCLUDE)
  endif()
endforeach()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/idl/msg/ DESTINATION share/stillmap/idl COMPONENT data
  FILES_MATCHING PATTERN "*.idl")

if(TARGET stillmap_python)
  # Where Debian's Python looks for packages, beneath any prefix.
  set(python_packages lib/python3/dist-packages)
  install(TARGETS stillmap_python LIBRARY DESTINATION ${python_packages}/stillmap COMPONENT python)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/clients/python/stillmap DESTINATION ${python_packages} COMPONENT python
    FILES_MATCHING PATTERN "*.py" PATTERN "*.pyi" PATTERN "py.typed")
  install(FILES ${PROJECT_SOURCE_DIR}/clients/python/recording_to_picture.ipynb
    DESTINATION share/doc/python3-stillmap/examples COMPONENT python)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION share/doc/python3-stillmap RENAME copyright COMPONENT python)
endif()

# The pages link to each other by their folders.
foreach(page . core core/odometry core/segmentation idl server clients clients/gateway config config/dds docker
        tests tests/drives tests/network tests/odometry tests/segmentation)
  install(FILES ${PROJECT_SOURCE_DIR}/${page}/README.md DESTINATION share/doc/stillmap/${page}
    COMPONENT tools)
endforeach()
install(FILES ${PROJECT_SOURCE_DIR}/clients/demo_map.png ${PROJECT_SOURCE_DIR}/clients/demo_path.png
  DESTINATION share/doc/stillmap/clients COMPONENT tools)
install(FILES ${PROJECT_SOURCE_DIR}/clients/gateway/lichtblick_layout.json
  DESTINATION share/doc/stillmap/clients/gateway COMPONENT tools)
install(FILES ${PROJECT_SOURCE_DIR}/clients/example/follow_and_query.cpp
  DESTINATION share/doc/stillmap/examples COMPONENT tools)
# The data have weights under a licence of their own.
file(READ ${PROJECT_SOURCE_DIR}/LICENSE STILLMAP_LICENCE)
configure_file(${CMAKE_CURRENT_LIST_DIR}/data_copyright.in ${PROJECT_BINARY_DIR}/data_copyright @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/data_copyright DESTINATION share/doc/stillmap-data RENAME copyright
  COMPONENT data)
foreach(package server:stillmap-server tools:stillmap)
  string(REPLACE ":" ";" package ${package})
  list(GET package 0 component)
  list(GET package 1 name)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION share/doc/${name} RENAME copyright
    COMPONENT ${component})
endforeach()

install(FILES ${CMAKE_CURRENT_LIST_DIR}/00-stillmap.conf DESTINATION lib/sysctl.d COMPONENT server)
install(FILES ${CMAKE_CURRENT_LIST_DIR}/secured.conf DESTINATION share/doc/stillmap-server/examples COMPONENT server)
# The prefix is known when installing; /usr keeps its configuration in /etc.
set(STILLMAP_PACKAGE_SOURCES ${CMAKE_CURRENT_LIST_DIR})
configure_file(${CMAKE_CURRENT_LIST_DIR}/install_service.cmake.in
  ${PROJECT_BINARY_DIR}/install_service.cmake @ONLY)
install(SCRIPT ${PROJECT_BINARY_DIR}/install_service.cmake COMPONENT server)

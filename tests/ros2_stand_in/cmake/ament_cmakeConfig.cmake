# ament_package() must be called once, last
macro(ament_package)
  install(FILES package.xml DESTINATION share/${PROJECT_NAME})
endmacro()

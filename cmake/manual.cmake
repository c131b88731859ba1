# Man pages and the completion of shells: the built program prints them from its own command line, `cmake --install` puts
# them where man, bash, zsh and fish look.
if(CMAKE_CROSSCOMPILING)
  return()
endif()
set(GRAUPEL_ZSH_FOLDER zsh/site-functions CACHE STRING "Folder of zsh's functions in share; of Debian's packages zsh/vendor-completions")
set(manual ${PROJECT_BINARY_DIR}/manual)
add_custom_command(OUTPUT ${manual}/made
  COMMAND ${CMAKE_COMMAND} -E rm -rf ${manual}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${manual}/bash ${manual}/zsh ${manual}/fish
  COMMAND graupel man --folder ${manual}/man1
  COMMAND graupel completion bash -o ${manual}/bash/graupel
  COMMAND graupel completion zsh -o ${manual}/zsh/_graupel
  COMMAND graupel completion fish -o ${manual}/fish/graupel.fish
  COMMAND ${CMAKE_COMMAND} -E touch ${manual}/made
  DEPENDS ${programs} tools/convert.py library/python/graupel/convert/flags.py
  COMMENT "Man pages and completion of shells" VERBATIM)
add_custom_target(graupel_manual ALL DEPENDS ${manual}/made)
install(DIRECTORY ${manual}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT manual)
install(FILES ${manual}/bash/graupel DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT manual)
install(FILES ${manual}/zsh/_graupel DESTINATION ${CMAKE_INSTALL_DATADIR}/${GRAUPEL_ZSH_FOLDER} COMPONENT manual)
install(FILES ${manual}/fish/graupel.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT manual)

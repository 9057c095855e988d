// A plugin for clang-tidy-19 that takes the declarations of system headers out of what the checks walk through. Without
// it every check visits all of Eigen, Boost and the standard library for every source file, which costs twenty seconds
// a file and finds nothing that would be shown. It is a saving of time only: the same findings come out without it.
//
// Built by cmake/rosid_tidy.cmake, loaded by cmake/tidy/check_source.sh. clang runs plugin actions of the kind used
// here before its main action, so the scope is set when the first check starts.

#include <clang/AST/ASTConsumer.h>
#include <clang/AST/ASTContext.h>
#include <clang/Basic/SourceManager.h>
#include <clang/Frontend/CompilerInstance.h>
#include <clang/Frontend/FrontendAction.h>
#include <clang/Frontend/FrontendPluginRegistry.h>

#include <memory>
#include <string>
#include <vector>

namespace rosid::tidy {

class ProjectScope : public clang::ASTConsumer {
 public:
  void HandleTranslationUnit(clang::ASTContext& context) override {
    const clang::SourceManager& sources = context.getSourceManager();
    std::vector<clang::Decl*> ours;
    for (clang::Decl* declaration : context.getTranslationUnitDecl()->decls()) {
      const clang::SourceLocation place = sources.getExpansionLoc(declaration->getLocation());
      if (place.isValid() && !sources.isInSystemHeader(place)) { ours.push_back(declaration); }
    }
    // An empty scope would mean "everything".
    if (!ours.empty()) { context.setTraversalScope(ours); }
  }
};

class ProjectScopeAction : public clang::PluginASTAction {
 protected:
  std::unique_ptr<clang::ASTConsumer> CreateASTConsumer(clang::CompilerInstance& /*compiler*/,
                                                        llvm::StringRef /*file*/) override {
    return std::make_unique<ProjectScope>();
  }
  bool ParseArgs(const clang::CompilerInstance& /*compiler*/, const std::vector<std::string>& /*arguments*/) override {
    return true;
  }
  ActionType getActionType() override { return AddBeforeMainAction; }
};

namespace {
const clang::FrontendPluginRegistry::Add<ProjectScopeAction> kRegistration("rosid-project-scope",
                                                                           "checks walk through our own code only");
}  // namespace

}  // namespace rosid::tidy

#include "idl/dds/security/identity.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>

#include "idl/dds/security/documents.hpp"
#include "idl/dds/security/signed_document.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;
using std::chrono::sys_seconds;

constexpr std::chrono::days soon{14};

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::string renewal(const fs::path& folder) {
  const std::string name = folder.filename().string();
  return "make it anew where the authority is kept: stillmap security add AUTHORITY " +
         (name.empty() ? folder.parent_path().filename().string() : name) + " --replace";
}

/// Looks at one identity, fault by fault.
class Inspection {
 public:
  Inspection(const fs::path& folder, sys_seconds now)
      : folder_(folder), files_(folder), now_(now) {}

  IdentityFaults inspect() {
    if (!files_are_there()) return std::move(found_);
    const auto authority = read_certificate(files_.identity_authority);
    const auto signer = read_certificate(files_.permissions_authority);
    const auto certificate = read_certificate(files_.certificate);
    const auto key = read_key();
    if (certificate) {
      check_dates(files_.certificate, certificate->validity());
      if (authority) check_issuer(*certificate, *authority);
      if (key) check_key(*certificate, *key);
    }
    if (authority) check_dates(files_.identity_authority, authority->validity());
    if (signer) {
      static_cast<void>(verified(files_.governance, *signer));
      const auto text = verified(files_.permissions, *signer);
      if (text && certificate) check_permissions(*text, *certificate);
    }
    return std::move(found_);
  }

 private:
  void fault(const std::string& text) { found_.faults.push_back(text); }

  bool files_are_there() {
    if (!fs::is_directory(folder_)) {
      fault(folder_.string() +
            " is no folder; --security takes the folder of one identity, such as keys/server, "
            "which 'stillmap security init keys' makes");
      return false;
    }
    if (fs::exists(folder_ / "authority")) {
      fault(folder_.string() + " is the folder of all identities; name one of them, such as " +
            (folder_ / "server").string());
      return false;
    }
    for (const fs::path& file :
         {files_.identity_authority, files_.permissions_authority, files_.certificate, files_.key,
          files_.governance, files_.permissions}) {
      look_at(file);
    }
    return found_.faults.empty();
  }

  void look_at(const fs::path& file) {
    struct stat facts {};
    if (::stat(file.c_str(), &facts) != 0) {
      const std::string reason = std::strerror(errno);
      return fault(file.string() + ": " + reason + "; copy the whole folder of the identity, or " +
                   renewal(folder_));
    }
    if (::access(file.c_str(), R_OK) != 0) {
      return fault(file.string() + " belongs to user " + std::to_string(facts.st_uid) +
                   " and cannot be read by user " + std::to_string(::geteuid()) + ": sudo chown " +
                   std::to_string(::geteuid()) + " " + file.string());
    }
    if (file == files_.key && (facts.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
      found_.warnings.push_back(
          file.string() + " is a private key that other users may read or change: chmod 600 " +
          file.string());
    }
  }

  std::optional<Certificate> read_certificate(const fs::path& file) {
    try {
      return Certificate::read(file);
    } catch (const SecurityError& error) {
      fault(std::string(error.what()) + "; " + renewal(folder_));
      return std::nullopt;
    }
  }

  std::optional<PrivateKey> read_key() {
    try {
      return PrivateKey::read(files_.key);
    } catch (const SecurityError& error) {
      fault(std::string(error.what()) + "; " + renewal(folder_));
      return std::nullopt;
    }
  }

  void check_dates(const fs::path& file, const Validity& validity) {
    if (now_ > validity.to) {
      fault(file.string() + " expired on " + to_text(validity.to) + "; " + renewal(folder_));
    } else if (now_ < validity.from) {
      fault(file.string() + " is valid from " + to_text(validity.from) +
            " only, and this machine's clock says " + to_text(now_) + ": set the clock");
    } else if (validity.to - now_ < soon) {
      found_.warnings.push_back(file.string() + " expires on " + to_text(validity.to) + "; " +
                                renewal(folder_));
    }
  }

  void check_issuer(const Certificate& certificate, const Certificate& authority) {
    if (certificate.is_signed_by(authority)) return;
    fault(files_.certificate.string() + " was not issued by the authority in " +
          files_.identity_authority.filename().string() + " (" + authority.subject() +
          "): files of two authorities are mixed; copy the whole folder again");
  }

  void check_key(const Certificate& certificate, const PrivateKey& key) {
    if (certificate.belongs_to(key)) return;
    fault(files_.key.string() + " is not the key of " + files_.certificate.filename().string() +
          "; copy both from the same identity");
  }

  std::optional<std::string> verified(const fs::path& file, const Certificate& signer) {
    auto text = verified_text(content(file), signer);
    if (!text) {
      fault(file.string() + " was changed, or not signed by the authority in " +
            files_.permissions_authority.filename().string() + "; " + renewal(folder_));
    }
    return text;
  }

  void check_permissions(const std::string& text, const Certificate& certificate) {
    const auto permissions = permissions_from_text(text);
    if (!permissions) {
      return fault(files_.permissions.string() + " has no grant that can be understood; " +
                   renewal(folder_));
    }
    if (permissions->subject != certificate.subject()) {
      fault(files_.permissions.string() + " is for " + permissions->subject +
            ", but the certificate is of " + certificate.subject() +
            "; copy the whole folder of one identity");
    }
    check_dates(files_.permissions, permissions->validity);
  }

  fs::path folder_;
  IdentityFiles files_;
  sys_seconds now_;
  IdentityFaults found_;
};

}  // namespace

IdentityFiles::IdentityFiles(const fs::path& folder)
    : identity_authority(folder / "identity_ca.cert.pem"),
      permissions_authority(folder / "permissions_ca.cert.pem"),
      certificate(folder / "cert.pem"),
      key(folder / "key.pem"),
      governance(folder / "governance.p7s"),
      permissions(folder / "permissions.p7s") {}

IdentityFaults check_identity(const fs::path& folder, sys_seconds now) {
  return Inspection(folder, now).inspect();
}

Identity load_identity(const fs::path& folder) {
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  const IdentityFaults found = check_identity(folder, now);
  if (!found.faults.empty()) {
    std::string text = "this identity cannot be used:";
    for (const std::string& fault : found.faults) text += "\n  " + fault;
    throw SecurityError(text);
  }
  const IdentityFiles files(folder);
  const Certificate certificate = Certificate::read(files.certificate);
  const auto text =
      verified_text(content(files.permissions), Certificate::read(files.permissions_authority));
  const auto permissions = text ? permissions_from_text(*text) : std::nullopt;
  if (!permissions) throw SecurityError(files.permissions.string() + " changed while it was read");
  return {.folder = fs::absolute(folder),
          .name = certificate.name(),
          .role = certificate.role(),
          .validity = certificate.validity(),
          .access = permissions->access};
}

}  // namespace stillmap::dds
